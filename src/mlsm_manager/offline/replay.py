"""Gives a recording to the localiser as the live graph would have given it."""

from collections import Counter
from dataclasses import dataclass
from time import process_time
from typing import Callable, Dict, List, Mapping, Optional, Sequence

import numpy as np

from mlsm_manager.joint_solver.hypotheses import Hypotheses
from mlsm_manager.joint_solver.live_solver import LiveSolver
from mlsm_manager.localisation.estimator import Estimator
from mlsm_manager.localisation.localiser import Localiser
from mlsm_manager.localisation.updates import ScanUpdate
from mlsm_manager.offline.recording import Recording
from mlsm_manager.offline.replay_parameters import ReplayParameters
from mlsm_manager.scan_matching.scan import Scan, Track
from mlsm_manager.scan_matching.scan_path import POSE
from mlsm_manager.surface_map.map_file import StoredMap
from node_support.errors import RefusedInput
from node_support.geometry import composed, inverse

ODOMETRY = "dead_reckoning"
CORRECTED = "corrected"


@dataclass(frozen=True)
class Replayed:
    """What came of a replay.

    times: (m,) s of the odometry. odometry, corrected: (m, 3) T_odom_base and T_map_base, the second as it was known
    at each moment. updates: of all scans that were taken, oldest first. refused: how many were not, by the reason.
    seconds: of a core for each scan.
    """

    times: np.ndarray
    odometry: np.ndarray
    corrected: np.ndarray
    estimator: Estimator
    updates: List[ScanUpdate]
    refused: Mapping[str, int]
    seconds: List[float]

    @property
    def poses(self) -> Dict[str, np.ndarray]:
        """Both trajectories by the names that files and plots give them."""
        return {ODOMETRY: self.odometry, CORRECTED: self.corrected}

    @property
    def scans(self) -> List[Scan]:
        """All scans that were taken, oldest first."""
        return [update.scan for update in self.updates]

    @property
    def hypotheses(self) -> Optional[Hypotheses]:
        """The joint solvers that have taken all scans; None where each was matched alone."""
        return self.estimator.hypotheses

    @property
    def solver(self) -> Optional[LiveSolver]:
        """The one of them that is believed."""
        return self.estimator.solver

    @property
    def matched(self) -> int:
        """Scans whose match was accepted."""
        return sum(update.accepted and update.result is not None for update in self.updates)

    @property
    def corrections(self) -> Optional[Track]:
        """T_map_odom at the ends of the scans, as known then; None where a scan has no belief."""
        if any(update.belief is None for update in self.updates):
            return None
        ends = np.array([update.scan.reference_time for update in self.updates])
        found = [composed(one.belief.theta[POSE], inverse(one.scan.reference_pose)) for one in self.updates]
        return Track(ends, np.array(found))

    @property
    def found_again(self) -> List[str]:
        """How the vehicle was found again after silences of the sonar, a line for each."""
        start = self.times[0]
        return [f"{one.scan.reference_time - start:.0f} s: {one.found}" for one in self.updates if one.found]

    @property
    def rejected(self) -> int:
        """Scans whose match was not accepted."""
        return sum(not update.accepted for update in self.updates)


def replay(
    recording: Recording,
    scans: Sequence[Scan],
    parameters: ReplayParameters,
    on_scans: Callable[[int], None],
    known: Optional[StoredMap] = None,
) -> Replayed:
    """Match the `scans` of corrected beams one after the other; `on_scans` is called with 1 after each of them.

    `known` is a map to start in, at a place in it that has to be found.

    A scan is used from the moment on at which its last beam and the odometry that the localiser waits for were known.
    One that is refused is left out, as the live node leaves it out.
    """
    localiser, track = parameters.build_localiser(recording.sonar_in_base), recording.track
    if known is not None:
        localiser.restore(known, same_odometry=False)
    corrections, updates, refused, seconds = np.empty((len(track.times), 3)), [], Counter(), []
    done = 0
    for scan in scans:
        known = max(done, int(np.searchsorted(track.times, scan.reference_time + localiser.lookahead, side="left")))
        corrections[done:known] = _corrections(localiser, track, done, known)
        done, start = known, process_time()
        try:
            updates.append(localiser.take_scan(scan).scan)
        except RefusedInput as reason:
            refused[reason.kind] += 1
        seconds.append(process_time() - start)
        on_scans(1)
    corrections[done:] = _corrections(localiser, track, done, len(track.times))
    corrected = composed(corrections, track.poses)
    return Replayed(track.times, track.poses, corrected, localiser.estimator, updates, refused, seconds)


def _corrections(localiser: Localiser, track: Track, start: int, end: int) -> np.ndarray:
    """Return T_map_odom (end - start, 3) at the track's times from number `start` to before number `end`."""
    found = [localiser.correction(float(track.times[one]), track.poses[one]) for one in range(start, end)]
    return np.array(found).reshape(-1, 3)
