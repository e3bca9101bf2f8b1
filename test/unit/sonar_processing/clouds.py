"""Clouds and beams of few numbers."""

import numpy as np

from sonar_processing.beams.beam import Beam
from sonar_processing.cloud import Cloud

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
        stamp_ns=seconds * SECOND,
        frame_id="sonar",
        angle=angle,
        intensities=np.array(strengths, dtype=np.uint8),
        range_resolution=resolution,
        sensor_angle=sensor_angle,
    )
