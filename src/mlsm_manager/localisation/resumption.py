"""Where the vehicle was in a stored map, and whether that still holds."""

from dataclasses import dataclass
from typing import Dict, Mapping, Optional

import numpy as np

from mlsm_manager.scan_matching.prediction import Belief
from mlsm_manager.scan_matching.scan import Track
from mlsm_manager.scan_matching.scan_path import POSE, STATES
from node_support.geometry import composed, inverse

# m and rad that a vehicle may have strayed from the stored correction while nobody watched: some seconds of a restart.
_STRAYED = np.array([1.0, 1.0, 0.1])
# s: in one or two turns of a head a vehicle hardly leaves a straight line.
_LONGEST_BRIDGE = 30.0
# So many scans in a row that do not match show that the vehicle is elsewhere.
_MOST_REJECTED = 3


@dataclass(frozen=True)
class StoredPlace:
    """correction: (3,) T_map_odom. belief: what was known then."""

    correction: np.ndarray
    belief: Belief

    def arrays(self) -> Dict[str, np.ndarray]:
        """Return it as arrays that a map's file keeps."""
        belief = self.belief
        return {
            "T_map_odom": self.correction,
            "time": np.array([belief.time]),
            "state": belief.theta,
            "covariance": belief.covariance,
        }

    @staticmethod
    def of_arrays(arrays: Mapping[str, np.ndarray]) -> "Optional[StoredPlace]":
        """Return what `arrays` gave; None where they hold no place."""
        shapes = {"T_map_odom": (3,), "time": (1,), "state": (STATES,), "covariance": (STATES, STATES)}
        if any(name not in arrays or arrays[name].shape != shape for name, shape in shapes.items()):
            return None
        if not all(np.isfinite(arrays[name]).all() for name in shapes):
            return None
        belief = Belief(float(arrays["time"][0]), arrays["state"], arrays["covariance"])
        return StoredPlace(arrays["T_map_odom"], belief)

    def bridged(self, track: Track) -> Track:
        """Return a track that goes straight from here to its beginning, where that is some seconds later.

        A node that is started again within a scan has no odometry of the seconds before. Where it was when it was saved
        is known, and with the odometry along a straight line the echoes of those seconds lie better than without any.
        """
        if not 0.0 < track.times[0] - self.belief.time < _LONGEST_BRIDGE:
            return track
        T_odom_base = composed(inverse(self.correction), self.belief.theta[POSE])
        times, poses = np.append(self.belief.time, track.times), np.vstack([T_odom_base, track.poses])
        return Track(times, poses)

    @property
    def widened(self) -> Belief:
        """The belief, as unsure of the pose as a restart makes it."""
        covariance = self.belief.covariance.copy()
        covariance[POSE, POSE] += np.diag(_STRAYED**2)
        return Belief(self.belief.time, self.belief.theta, covariance)


class PlaceSearch:
    """Decides, scan by scan after a map was loaded, whether the place is known, expected or lost."""

    def __init__(self) -> None:
        self.forget()

    def forget(self) -> None:
        """Take the place as known."""
        self._left: Optional[int] = None
        self._is_expected = False

    def expect(self) -> None:
        """Take the place as near to where it is expected."""
        self._left = _MOST_REJECTED
        self._is_expected = True

    def lose(self) -> None:
        """Take the place as anywhere in the map."""
        self._left = 0
        self._is_expected = False

    def jump(self) -> None:
        """Learn that time jumped: what was expected does not hold any more."""
        if self._left is not None:
            self.lose()

    @property
    def is_lost(self) -> bool:
        """Whether the whole map must be searched."""
        return self._left == 0

    @property
    def may_be_near(self) -> bool:
        """Whether the vehicle may still be where it is expected, also when the whole map is searched."""
        return self._is_expected

    def learn(self, accepted: bool) -> None:
        """Learn whether a scan was matched."""
        if accepted:
            self.forget()
        elif self._left:
            self._left -= 1
