"""What map_bag leaves in its folder."""

import json

import matplotlib.image
import numpy as np
import pytest
from made_blocks import *  # noqa: F403

from mlsm_manager.mapping.recording import Recording, Truth
from mlsm_manager.matching.scan import Track
from mlsm_manager.mlsm import MultiLevelSurfaceMap
from mlsm_manager.run_files import CORRECTED, ODOMETRY, Run, errors_of, write_run, write_summary
from mlsm_manager.storage import read_ply
