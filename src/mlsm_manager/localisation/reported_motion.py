"""What tf alone tells of an odometry: whether positions change, and headings."""

import numpy as np

from mlsm_manager.localisation.odometry_profiles import OdometryKind
from mlsm_manager.scan_matching.scan import Track
from node_support.geometry import wrapped

_STANDS = 0.05  # m: a position that moves by less never changed, but for rounding and lever arms of a tilting base
_TURNS = 0.02  # rad: a compass at rest says less, a vehicle that travels turns more


class ReportedMotion:
    """How far T_odom_base changed since it was first known.

    extent: m, of the positions along x or y. turned: rad, between the most different headings.
    """

    def __init__(self) -> None:
        self._low, self._high = np.full(3, np.inf), np.full(3, -np.inf)
        self._first_yaw = np.nan

    def learn(self, track: Track) -> None:
        """Learn what was reported on a track."""
        if not len(track.times):
            return
        poses = track.poses.copy()
        if np.isnan(self._first_yaw):
            self._first_yaw = poses[0, 2]
        poses[:, 2] = wrapped(poses[:, 2] - self._first_yaw)
        self._low = np.minimum(self._low, poses.min(axis=0))
        self._high = np.maximum(self._high, poses.max(axis=0))

    @property
    def extent(self) -> float:
        """By how much positions changed, m."""
        return float(np.max(self._high[:2] - self._low[:2]))

    @property
    def turned(self) -> float:
        """By how much the heading changed, rad; at most a turn."""
        return float(self._high[2] - self._low[2])

    @property
    def has_positions(self) -> bool:
        """Whether positions changed."""
        return self.extent > _STANDS

    @property
    def has_headings(self) -> bool:
        """Whether the heading changed."""
        return self.turned > _TURNS

    @property
    def kind(self) -> OdometryKind:
        """HEADING where only the heading changed; else AUTO: echoes tell how wrong positions are."""
        return OdometryKind.HEADING if self.has_headings and not self.has_positions else OdometryKind.AUTO
