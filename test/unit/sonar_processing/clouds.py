"""Clouds and beams of few numbers, and assemblers to give them to."""

import numpy as np

from sonar_processing.beams.beam import Beam, PlacedBeam
from sonar_processing.cloud import Cloud
from sonar_processing.scans.assembler import ScanAssembler
from sonar_processing.scans.parameters import SonarToCloudParameters

SECOND = 10**9


def cloud_of(strengths, height=1):
    """Return a cloud along +x whose points have these strengths and the stamps 1, 2, 3 and so on."""
    strengths = np.asarray(strengths, dtype=np.float32)
    points = np.zeros((len(strengths), 4), dtype=np.float32)
    points[:, 0] = np.arange(len(strengths))
    points[:, 3] = strengths
    return Cloud(points, np.arange(1.0, len(strengths) + 1), 5 * SECOND, "odom", height)


def beam_of(strengths=(10, 20, 30), angle=0.0, resolution=1.0, seconds=1, sensor_angle=0.0):
    """Return a beam with bins of one metre."""
    return Beam(
        stamp_ns=round(seconds * SECOND),
        frame_id="sonar",
        angle=angle,
        intensities=np.array(strengths, dtype=np.uint8),
        range_resolution=resolution,
        sensor_angle=sensor_angle,
    )


def assembler_with(**values):
    """Return an assembler with these parameters, and without a least range unless it is one of them."""
    return ScanAssembler(SonarToCloudParameters(**{"min_range": 0.0, **values}))


def placed(*, moving=False, shift=(0.0, 0.0, 0.0), **beam):
    """Return a beam, as `beam_of` makes it, of a sonar at `shift` (3,) m that is not turned."""
    pose = np.eye(4)
    pose[:3, 3] = shift
    return PlacedBeam(beam_of(**beam), pose, moving)
