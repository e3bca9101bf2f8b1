"""The tour of the basin that is part of the repository, as messages."""

from typing import Dict, List, Tuple

import numpy as np
import rosbag

from benchmarks.graph import ROOT
from node_support.ros.transforms import matrix_from_message
from underwater_map_construction.msg import SonarScanLine


def basin_messages() -> Tuple[List[SonarScanLine], Dict[int, np.ndarray]]:
    """Return the beams in the order of time, and T_odom_sonar (4, 4) at the stamp [ns] of each."""
    messages, poses = [], {}
    with rosbag.Bag(str(ROOT / "test/data/basin.bag")) as bag:
        for topic, message, stamp in bag.read_messages(["/sonar/raw", "/tf"]):
            if topic == "/tf":
                poses[stamp.to_nsec()] = matrix_from_message(message.transforms[0].transform)
            else:
                messages.append(message)
    return messages, poses
