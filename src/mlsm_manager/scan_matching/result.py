"""What a matcher takes besides scan and map, and what it returns."""

from dataclasses import dataclass
from enum import Enum
from typing import Protocol

import numpy as np

from mlsm_manager.scan_matching.scan import Scan
from mlsm_manager.surface_map.blocks import BlockSource
from node_support.geometry import composed, inverse, transformed, wrapped


class MatchStatus(Enum):
    """Whether a match holds, and if not, why."""

    CONVERGED = "converged"
    TOO_FEW_POINTS = "too few points"
    DIVERGED = "diverged"
    AMBIGUOUS = "ambiguous"
    REJECTED_JUMP = "rejected jump"


@dataclass(frozen=True)
class Prior:
    """What odometry and earlier matches tell before a scan is matched; its covariance must be true.

    correction: (3,) planar T_map_odom at the scan's reference time; the pose it gives is T_map_odom * T_odom_base.
    rate: (3,) error of the odometry's velocity during the scan, m/s, m/s, rad/s in the vehicle's frame: the true
        body velocity is the odometry's plus this.
    motion: (2,) relative error of the distances that the odometry reports, and error of their direction [rad]:
        the vehicle went 1 + motion[0] times as far, turned by motion[1] counter-clockwise.
    covariance: (8, 8) of [pose, rate, motion]; pose: x y [m] in map, yaw [rad] of base_link at the reference time.
        A state without variance is fixed.
    """

    correction: np.ndarray
    rate: np.ndarray
    motion: np.ndarray
    covariance: np.ndarray

    def pose(self, scan: Scan) -> np.ndarray:
        """Return the (3,) T_map_base expected at the scan's reference time."""
        return composed(self.correction, scan.reference_pose)


@dataclass(frozen=True)
class MatchResult:
    """Where a scan was taken. Only an `accepted` one says more than the prior did.

    pose: (3,) T_map_base, x y [m] yaw [rad], at the scan's reference time.
    velocity: (3,) in the vehicle's frame at the reference time, m/s, m/s, rad/s.
    covariance: (6, 6) of [pose, velocity], prior included.
    rate, motion, state_covariance: as in `Prior`, after the match; the covariance is (8, 8) of [pose, rate, motion].
    error: mean distance of the used points from the map, m. seconds: time the match took.
    beam_times, beam_poses: (b,) s increasing and (b, 3) T_map_base at those times; between them the path is linear.
    reason: one line that says why a match was not accepted, with the value that decided; empty when it was accepted.
    """

    status: MatchStatus
    pose: np.ndarray
    velocity: np.ndarray
    covariance: np.ndarray
    rate: np.ndarray
    motion: np.ndarray
    state_covariance: np.ndarray
    error: float
    points_used: int
    iterations: int
    seconds: float
    beam_times: np.ndarray
    beam_poses: np.ndarray
    reason: str = ""

    @property
    def accepted(self) -> bool:
        """Whether the match holds."""
        return self.status is MatchStatus.CONVERGED

    def correction(self, scan: Scan) -> np.ndarray:
        """Return the (3,) T_map_odom at the scan's reference time that this pose means."""
        correction = composed(self.pose, inverse(scan.reference_pose))
        correction[2] = wrapped(correction[2])
        return correction


class Matcher(Protocol):
    """Finds where a scan lies among blocks."""

    def match(self, scan: Scan, target: BlockSource, prior: Prior) -> MatchResult:
        """Return where the scan was taken; never raises for a scan or a target that cannot be matched.

        `target` gives the blocks in map; a matcher fetches those within the scan's reach, or all.
        """


def corrected_points(scan: Scan, result: MatchResult) -> np.ndarray:
    """Return (n, 4) points in map: each taken from the odometry's pose to the matched pose at its own beam's time."""
    path = np.stack([np.interp(scan.times, result.beam_times, column) for column in result.beam_poses.T], axis=-1)
    return transformed(composed(path, inverse(scan.track.at(scan.times))), scan.points)
