"""Places the bins of a beam in space (thesis 6.5.2)."""

import math

import numpy as np

from sonar_processing.beams.beam import Beam


def project_beam(beam: Beam, T_target_sonar: np.ndarray, dispersed_points: int, beam_width: float) -> np.ndarray:
    """Return (dispersed_points * bins, 4) float32: x y z [m] in the target frame and echo strength.

    Every bin is drawn as `dispersed_points` points side by side across the horizontal `beam_width` [rad]; one point
    lies on the beam's axis. Points come ordered by side, then by range. T_target_sonar is (4, 4).
    """
    headings = beam.angle + _offsets(dispersed_points, beam_width)
    directions = np.column_stack([np.cos(headings), np.sin(headings)]) @ T_target_sonar[:3, :2].T
    points = np.empty((dispersed_points, beam.intensities.size, 4), dtype=np.float32)
    points[..., :3] = directions[:, np.newaxis, :] * beam.ranges[:, np.newaxis] + T_target_sonar[:3, 3]
    points[..., 3] = beam.intensities
    return points.reshape(-1, 4)


def _offsets(count: int, beam_width: float) -> np.ndarray:
    if count == 1:
        return np.zeros(1)
    return np.linspace(-beam_width / 2.0, beam_width / 2.0, count)


def wrapped(angle: float) -> float:
    """Return the angle in [-pi, pi)."""
    return (angle + math.pi) % (2.0 * math.pi) - math.pi
