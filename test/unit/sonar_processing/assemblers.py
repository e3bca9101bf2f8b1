"""Assemblers of scans, and beams to give to them."""

import numpy as np
from clouds import beam_of

from sonar_processing.beams.beam import PlacedBeam
from sonar_processing.scans.assembler import ScanAssembler
from sonar_processing.scans.parameters import SonarToCloudParameters


def assembler_with(**values):
    """Return an assembler with these parameters, and without a least range unless it is one of them."""
    return ScanAssembler(SonarToCloudParameters(**{"min_range": 0.0, **values}))


def placed(*, moving=False, shift=(0.0, 0.0, 0.0), **beam):
    """Return a beam, as `beam_of` makes it, of a sonar at `shift` (3,) m that is not turned."""
    pose = np.eye(4)
    pose[:3, 3] = shift
    return PlacedBeam(beam_of(**beam), pose, moving)
