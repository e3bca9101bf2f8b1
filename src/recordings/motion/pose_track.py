"""The poses of one frame in another over time; quaternions are x y z w."""

from dataclasses import dataclass

import numpy as np

from node_support.geometry import quaternion_of, rotation_matrices

FARTHEST = 1e8  # m from the origin: beyond all coordinates of maps; what is farther was never measured
LATEST_NS = 2**31 * 10**9  # from there on ROS has no stamps
_NORMS = (0.5, 2.0)  # of quaternions; a norm outside says that something else than a rotation was written


@dataclass(frozen=True)
class PoseTrack:
    """stamps_ns: (n,) int64, increasing, n > 0. translations: (n, 3) m. rotations: (n, 4) unit quaternions, x y z w.

    is_fixed: the first pose holds at all times.
    """

    stamps_ns: np.ndarray
    translations: np.ndarray
    rotations: np.ndarray
    is_fixed: bool = False

    @classmethod
    def sorted_from(cls, stamps_ns: np.ndarray, translations: np.ndarray, rotations: np.ndarray) -> "PoseTrack":
        """Return the track of n poses in any order; of several with one stamp the first counts, as in tf2.

        Those that are farther than `FARTHEST`, at no time of ROS, not finite or no rotation are left out; the track
        may then be empty.
        """
        rotations = _normalized(np.asarray(rotations, dtype=np.float64).reshape(-1, 4))
        translations = np.asarray(translations, dtype=np.float64).reshape(-1, 3)
        with np.errstate(invalid="ignore"):
            valid = np.isfinite(rotations).all(axis=1) & (np.abs(translations) <= FARTHEST).all(axis=1)
        stamps_ns = np.asarray(stamps_ns, dtype=np.int64)
        valid &= (stamps_ns > -LATEST_NS) & (stamps_ns < LATEST_NS)
        kept, first = np.unique(stamps_ns[valid], return_index=True)
        return cls(kept, translations[valid][first], rotations[valid][first])

    @classmethod
    def fixed(cls, translation: np.ndarray, rotation: np.ndarray) -> "PoseTrack":
        """Return a pose that never changes: translation (3,) m, rotation (4,) x, y, z, w.

        Raises ValueError if it is no pose.
        """
        track = cls.sorted_from(np.zeros(1, dtype=np.int64), translation, rotation)
        if not len(track):
            raise ValueError(f"translation {translation}, quaternion {rotation}: no pose")
        return cls(track.stamps_ns, track.translations, track.rotations, is_fixed=True)

    def __len__(self) -> int:
        return len(self.stamps_ns)

    def covers(self, stamps_ns: np.ndarray) -> np.ndarray:
        """Return for each stamp (k,) whether a pose is known then: between the first and the last one."""
        if self.is_fixed:
            return np.ones(len(stamps_ns), dtype=bool)
        return (stamps_ns >= self.stamps_ns[0]) & (stamps_ns <= self.stamps_ns[-1])

    def at(self, stamps_ns: np.ndarray) -> np.ndarray:
        """Return poses (k, 4, 4) at stamps (k,), between known ones on the shortest way, beyond them the nearest."""
        if self.is_fixed or len(self) == 1:
            index = np.zeros(len(stamps_ns), dtype=np.int64)
            return _matrices(self.translations[index], self.rotations[index])
        after = np.clip(np.searchsorted(self.stamps_ns, stamps_ns), 1, len(self) - 1)
        before = after - 1
        # Differences first: float64 does not hold nanoseconds since 1970.
        step = (self.stamps_ns[after] - self.stamps_ns[before]).astype(np.float64)
        share = np.clip((stamps_ns - self.stamps_ns[before]) / step, 0.0, 1.0)
        translations = (1.0 - share)[:, np.newaxis] * self.translations[before]
        translations += share[:, np.newaxis] * self.translations[after]
        return _matrices(translations, _between(self.rotations[before], self.rotations[after], share))

    def mounted(self, T_vehicle_instrument: np.ndarray) -> "PoseTrack":
        """Return the orientations of the vehicle, at the origin, where the track has those of an instrument on it."""
        turns = np.tile(np.eye(4), (len(self), 1, 1))
        turns[:, :3, :3] = rotation_matrices(self.rotations) @ T_vehicle_instrument[:3, :3].T
        rotations = np.array([quaternion_of(turn) for turn in turns])
        return PoseTrack(self.stamps_ns, np.zeros((len(self), 3)), rotations, self.is_fixed)

    def turned_up(self) -> "PoseTrack":
        """Return the track from north, east, down to x, y left, z up: both frames by half a turn about x."""
        translations = self.translations * [1.0, -1.0, -1.0]
        rotations = self.rotations * [1.0, -1.0, -1.0, 1.0]
        return PoseTrack(self.stamps_ns, translations, rotations, self.is_fixed)


def _matrices(translations: np.ndarray, rotations: np.ndarray) -> np.ndarray:
    matrices = np.zeros((len(translations), 4, 4))
    matrices[:, :3, :3] = rotation_matrices(_normalized(rotations))
    matrices[:, :3, 3] = translations
    matrices[:, 3, 3] = 1.0
    return matrices


def _normalized(quaternions: np.ndarray) -> np.ndarray:
    """Return quaternions (..., 4) of length one; NaN for those that are no rotation or not finite."""
    with np.errstate(over="ignore", invalid="ignore"):
        norms = np.linalg.norm(quaternions, axis=-1, keepdims=True)
        valid = (norms > _NORMS[0]) & (norms < _NORMS[1])
        return np.where(valid, quaternions / np.where(valid, norms, 1.0), np.nan)


def _between(first: np.ndarray, second: np.ndarray, share: np.ndarray) -> np.ndarray:
    """Return the rotation at `share` (n,) of the shortest way from `first` (n, 4) to `second` (n, 4), as tf2 does."""
    cosine = np.einsum("ni,ni->n", first, second)
    second = np.where(cosine[:, np.newaxis] < 0.0, -second, second)
    angle = np.arccos(np.clip(np.abs(cosine), 0.0, 1.0))
    apart = angle > 0.0
    sine = np.where(apart, np.sin(angle), 1.0)
    left = np.where(apart, np.sin((1.0 - share) * angle) / sine, 1.0)
    right = np.where(apart, np.sin(share * angle) / sine, 0.0)
    return left[:, np.newaxis] * first + right[:, np.newaxis] * second
