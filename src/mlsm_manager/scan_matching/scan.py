"""A scan, a cloud, and what a matcher takes besides a scan and returns."""

from dataclasses import dataclass, replace
from enum import Enum
from typing import Optional, Protocol, Sequence, Tuple, Union

import numpy as np

from mlsm_manager.surface_map.blocks import BlockSource
from node_support.errors import RefusedInput
from node_support.geometry import move_of, seen_from, transformed, wrapped

_ROUNDING = 1e-6  # m


@dataclass(frozen=True)
class Track:
    """The vehicle's way by odometry. Raises RefusedInput when times are not finite or do not increase.

    times: (m,) s, increasing, m > 0. poses: (m, 3) T_odom_base, x y [m] and yaw [rad]. lost: (m,) s, of those since the
    pose before, in which nothing told how far the vehicle went; by default none.
    """

    times: np.ndarray
    poses: np.ndarray
    lost: Optional[np.ndarray] = None

    def __post_init__(self) -> None:
        times = np.asarray(self.times, dtype=np.float64)
        poses = np.array(self.poses, dtype=np.float64)
        if len(times) != len(poses) or not len(times):
            raise RefusedInput("tracks refused", f"{len(times)} times for {len(poses)} poses")
        if not (np.isfinite(times).all() and np.isfinite(poses).all() and (np.diff(times) > 0.0).all()):
            raise RefusedInput("tracks refused", "times must be finite and increase, poses must be finite")
        poses[:, 2] = np.unwrap(poses[:, 2])
        object.__setattr__(self, "times", times)
        object.__setattr__(self, "poses", poses)
        object.__setattr__(self, "lost", np.zeros(len(times)) if self.lost is None else self.lost)

    def chosen(self, rows: Union[slice, np.ndarray]) -> "Track":
        """Return the poses `rows`, a slice or (m,) bool."""
        return Track(self.times[rows], self.poses[rows], self.lost[rows])

    @property
    def reports_positions(self) -> bool:
        """Whether positions change; a step that was taken out of some that never do leaves a rounding."""
        return bool(np.ptp(self.poses[:, :2], axis=0).max() > _ROUNDING)

    def with_poses(self, poses: np.ndarray) -> "Track":
        """Return the track with other poses (m, 3)."""
        return replace(self, poses=poses)

    def at(self, times: np.ndarray) -> np.ndarray:
        """Return T_odom_base (..., 3) at `times` (...), between the known poses linearly, beyond them the nearest."""
        columns = [np.interp(times, self.times, self.poses[:, axis]) for axis in range(3)]
        return np.stack(columns, axis=-1)

    def velocity_at(self, time: float) -> np.ndarray:
        """Return the (3,) velocity in the body frame, m/s, m/s, rad/s, over up to a second that ends at `time`."""
        first = max(time - 1.0, self.times[0])
        last = min(time, self.times[-1])
        if last <= first:
            return np.zeros(3)
        before, after = self.at(np.array([first, last]))
        return seen_from(before, after) / (last - first)


def joined(tracks: Sequence[Track]) -> Track:
    """Return one track of all poses; of several at one time the first."""
    different = list({id(track): track for track in tracks}.values())
    if len(different) == 1:
        return different[0]
    times, first = np.unique(np.concatenate([track.times for track in different]), return_index=True)
    return Track(times, np.concatenate([track.poses for track in different])[first])


@dataclass(frozen=True)
class Scan:
    """Points of one scan. Raises RefusedInput when the arrays do not belong together.

    points: (n, 4) float64, x y z [m] and echo strength in `odom`, each placed by the odometry at its own beam's time.
    times: (n,) s, when each point's beam was taken. moving: (n,) bool, whether the vehicle moved then.
    track: the odometry, which must cover the times. reference_time: s, of the newest beam.
    """

    points: np.ndarray
    times: np.ndarray
    moving: np.ndarray
    track: Track
    reference_time: float

    def __post_init__(self) -> None:
        count = len(self.points)
        if self.points.shape != (count, 4) or self.times.shape != (count,) or self.moving.shape != (count,):
            raise RefusedInput(
                "scans refused", f"points {self.points.shape}, times {self.times.shape}, moving {self.moving.shape}"
            )

    @classmethod
    def from_stamps(cls, points: np.ndarray, time_stamps: np.ndarray, reference_time: float, track: Track) -> "Scan":
        """Build from a cloud's points (n, 4) and signed time stamps (n,): negative while still (thesis 4.5.1).

        Points that are not finite are left out.
        """
        points, stamps = _finite(points, time_stamps)
        return cls(points, np.abs(stamps), stamps > 0.0, track, reference_time)

    def __len__(self) -> int:
        return len(self.points)

    def with_odometry(self) -> "Scan":
        """Return it without the points from before its track begins: where they were heard is not known."""
        return self.chosen(self.times >= self.track.times[0])

    def chosen(self, kept: np.ndarray) -> "Scan":
        """Return it with those of its points that are kept (n,)."""
        if kept.all():
            return self
        return Scan(self.points[kept], self.times[kept], self.moving[kept], self.track, self.reference_time)

    def without_points(self, end: float) -> "Scan":
        """Return a scan that ends at `end` [s] and heard nothing, with the same odometry."""
        return Scan(np.empty((0, 4)), np.empty(0), np.empty(0, dtype=bool), self.track, end)

    @property
    def start(self) -> float:
        """Time of the oldest point, s; the reference time when there is none."""
        return float(self.times.min()) if len(self) else self.reference_time

    @property
    def reference_pose(self) -> np.ndarray:
        """(3,) T_odom_base at the reference time."""
        return self.track.at(self.reference_time)

    def correction_to(self, T_map_base: np.ndarray) -> np.ndarray:
        """Return the T_map_odom (3,) that puts the vehicle to T_map_base (3,) at the reference time."""
        correction = move_of(self.reference_pose, T_map_base)
        correction[2] = wrapped(correction[2])
        return correction


@dataclass(frozen=True)
class MapCloud:
    """points: (n, 4) float64, x y z [m] in odom and echo strength. times: (n,) s. end: s, stamp of the newest beam."""

    points: np.ndarray
    times: np.ndarray
    end: float

    @classmethod
    def from_stamps(cls, points: np.ndarray, time_stamps: np.ndarray, end: float) -> "MapCloud":
        """Build from a cloud's points (n, 4) and signed time stamps (n,); points that are not finite are left out."""
        points, stamps = _finite(points, time_stamps)
        return cls(points, np.abs(stamps), end)

    @classmethod
    def of_scan(cls, scan: Scan) -> "MapCloud":
        return cls(scan.points, scan.times, scan.reference_time)

    def chosen(self, kept: np.ndarray) -> "MapCloud":
        """Return it with those of its points that are kept (n,)."""
        return self if kept.all() else MapCloud(self.points[kept], self.times[kept], self.end)

    @classmethod
    def joined(cls, clouds: "Sequence[MapCloud]") -> "MapCloud":
        """Return the points of clouds (at least one), one after the other, as one cloud."""
        points, times = ([getattr(cloud, name) for cloud in clouds] for name in ("points", "times"))
        return cls(np.concatenate(points), np.concatenate(times), max(cloud.end for cloud in clouds))

    def __len__(self) -> int:
        return len(self.points)


def _finite(points: np.ndarray, time_stamps: np.ndarray) -> Tuple[np.ndarray, np.ndarray]:
    """Return points (n, 4) and their time stamps (n,), both finite, as float64."""
    points, stamps = np.asarray(points, dtype=np.float64), np.asarray(time_stamps, dtype=np.float64)
    valid = np.isfinite(points).all(axis=1) & np.isfinite(stamps)
    return points[valid], stamps[valid]


class MatchStatus(Enum):
    """Whether a match holds, and if not, why."""

    CONVERGED = "converged"
    TOO_FEW_POINTS = "too few points"
    DIVERGED = "diverged"
    AMBIGUOUS = "ambiguous"
    REJECTED_JUMP = "rejected jump"


@dataclass(frozen=True)
class Fading:
    """Errors of speed and turn rate return to what is usual (the mean of an Ornstein-Uhlenbeck process).

    usual: (3,) m/s, m/s, rad/s in base_link. times: (3,) s within which their differences from it fall to a third;
    infinity where they stay.
    """

    usual: np.ndarray
    times: np.ndarray

    def after(self, rates: np.ndarray, seconds: float) -> np.ndarray:
        """Return the errors (3,) that are expected `seconds` after they were `rates` (3,)."""
        return self.usual + np.exp(-seconds / self.times) * (rates - self.usual)

    def to_a_stop(self) -> "Fading":
        """Return one with which the vehicle comes to rest."""
        return replace(self, usual=np.zeros_like(self.usual))


@dataclass(frozen=True)
class Belief:
    """What is known at a time, its covariance (8, 8) included, which must be true.

    theta: (8,) as in scan_path. T_map_base: x y [m], yaw [rad]; the error of the odometry's velocity in base_link, m/s,
    m/s, rad/s: the true one is the reported one plus this; the relative error of the distances that are reported, and
    that of their direction [rad]. A state without variance is fixed. fading: how the rates go on until the next belief;
    None where they stay.
    """

    time: float
    theta: np.ndarray
    covariance: np.ndarray
    fading: Optional[Fading] = None


@dataclass(frozen=True)
class MatchResult:
    """Where a scan was taken. Only an `accepted` one says more than what was believed before.

    belief: at the scan's reference time, what was believed before included.
    velocity: (3,) in the vehicle's frame at the reference time, m/s, m/s, rad/s.
    covariance: (6, 6) of [pose, velocity].
    error: mean distance of the used points from the map, m. seconds: time the match took.
    reason: one line that says why a match was not accepted, with the value that decided; empty when it was accepted.
    beam_times, beam_poses: (b,) s increasing and (b, 3) T_map_base at those times; between them the path is linear.
    """

    status: MatchStatus
    belief: Belief
    velocity: np.ndarray
    covariance: np.ndarray
    error: float
    points_used: int
    seconds: float
    beam_times: np.ndarray
    beam_poses: np.ndarray
    reason: str = ""

    @property
    def accepted(self) -> bool:
        return self.status is MatchStatus.CONVERGED

    @property
    def pose(self) -> np.ndarray:
        """(3,) T_map_base, x y [m] yaw [rad], at the scan's reference time."""
        return self.belief.theta[:3]

    def widened(self, covariance: np.ndarray) -> "MatchResult":
        """Return the match with an uncertain position, by a `covariance` (2, 2) m^2 besides its own."""
        whole = self.covariance.copy()
        whole[:2, :2] += covariance
        return replace(self, covariance=whole)


class Matcher(Protocol):
    """Finds where a scan lies among blocks."""

    def match(self, scan: Scan, target: BlockSource, belief: Belief) -> MatchResult:
        """Return where the scan was taken; never raises for a scan or a target that cannot be matched.

        `target` gives the blocks in map; a matcher fetches those within the scan's reach, or all. belief: before the
        match, at the scan's reference time.
        """


def corrected_points(scan: Scan, result: MatchResult) -> np.ndarray:
    """Return (n, 4) points in map: each taken from the odometry's pose to the matched pose at its own beam's time."""
    path = np.stack([np.interp(scan.times, result.beam_times, column) for column in result.beam_poses.T], axis=-1)
    return transformed(move_of(scan.track.at(scan.times), path), scan.points)
