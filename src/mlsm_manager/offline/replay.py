"""Parameters of map_bag, live.yaml, and a recording given to the localiser as the live graph would have given it."""

from collections import Counter
from dataclasses import dataclass, fields, replace
from time import process_time
from typing import Any, Callable, Dict, List, Mapping, Optional, Sequence, Tuple, Type

import numpy as np
import yaml

from mlsm_manager.joint_solver.live_solver import LiveSolver
from mlsm_manager.joint_solver.parameters import SolverParameters
from mlsm_manager.joint_solver.rival_solvers import RivalSolvers
from mlsm_manager.localisation.estimator import Estimator
from mlsm_manager.localisation.localiser import Localiser
from mlsm_manager.localisation.parameters import LocaliserParameters, MapInput, MatchInput, MlsmCoreParameters
from mlsm_manager.localisation.place_now import PlaceNow
from mlsm_manager.localisation.updates import ScanUpdate
from mlsm_manager.offline.recording import Recording
from mlsm_manager.offline.thesis_chain import ThesisChain
from mlsm_manager.scan_matching.scan import Scan, Track
from mlsm_manager.scan_matching.scan_path import POSE
from mlsm_manager.surface_map.map_file import StoredMap
from node_support.errors import RefusedInput
from node_support.geometry import composed, move_of
from node_support.node_table import NODES as LIVE_NODES
from node_support.parameters import ParameterSet, with_defaults
from recordings.reader import ReadingParameters
from sonar_processing.beams.parameters import BeamCorrection
from sonar_processing.filters.echo_extractor import EchoExtractorParameters
from sonar_processing.scans.parameters import SonarToCloudParameters

_ALL = 10**9  # scans
_SILENT = 60.0  # s: a turn of a slow head and another one, within which a real sonar may hear nothing


@dataclass(frozen=True)
@with_defaults(pulse_sigma=0.0, threshold_share=0.5, min_height=2.0)
class ReplayParameters(LocaliserParameters, ReadingParameters, BeamCorrection, EchoExtractorParameters):
    """All that --set may change, with the defaults of the live nodes, but for weak and wide echoes.

    These suit recordings of real heads. Live, a compass alone lost its way with them in the simulated harbour.
    """

    def echoes(self) -> EchoExtractorParameters:
        return self.part(EchoExtractorParameters)

    def solver_parameters(self) -> SolverParameters:
        return replace(super().solver_parameters(), kept_scans=_ALL)


NODES: Dict[str, Type[ParameterSet]] = {
    "sonar_to_cloud": SonarToCloudParameters,
    "echo_extractor": EchoExtractorParameters,
    "mlsm_core": MlsmCoreParameters,
}


@dataclass(frozen=True)
class _CloudParameters(ReadingParameters, BeamCorrection):
    """What sonar_to_cloud and a replay know by the same name and meaning."""


_SHARED: Dict[str, Type[ParameterSet]] = {**NODES, "sonar_to_cloud": _CloudParameters}
_COMMENT = "# Written by map_bag. mapping.launch, vehicle.launch and play_bag.launch take it as parameters:=FILE.\n"


def live_values(
    parameters: ReplayParameters, odom_frame: str, base_frame: str, chain: Optional[ThesisChain] = None
) -> Dict[str, Dict[str, Any]]:
    """Return for each node the parameters with which it does what a replay with `parameters` did.

    chain: what made the scans, where they are not echoes.
    """
    values = {name: _common(parameters.to_mapping(), name) for name in NODES}
    if chain is None:
        cloud = SonarToCloudParameters()
        own = {"min_range": cloud.min_range, "height_limit": cloud.height_limit}
        values["sonar_to_cloud"].update(target_frame=odom_frame, **own)
    else:
        values["sonar_to_cloud"] = {**chain.clouds.to_mapping(), **values["sonar_to_cloud"], "target_frame": odom_frame}
    values["mlsm_core"].update(
        size_x_meters=0.0,
        size_y_meters=0.0,
        map_frame="map" if odom_frame != "map" else "corrected_map",
        odom_frame=odom_frame,
        base_frame=base_frame,
        match_input=(MatchInput.ECHOES if chain is None else MatchInput.CLEANED).value,
        map_input=MapInput.MATCHED.value,
        start_matching=True,
    )
    stages = {} if chain is None else chain.stages
    return {**{name: NODES[name].nested(own) for name, own in values.items()}, **stages}


def replay_values(values: Mapping[str, Any]) -> Tuple[Dict[str, Any], List[str]]:
    """Return values by the names of ReplayParameters, and a remark on each key of an older version.

    values: may hold some of them by node, as live.yaml does. Keys of the live nodes that a replay does not know are
    left out, and nodes of which a replay knows nothing. Raises ParameterError for what a node would refuse.
    """
    plain = {key: value for key, value in values.items() if key not in LIVE_NODES}
    found, remarks = ReplayParameters.by_name(plain)
    for name in NODES:
        if name in values:
            NODES[name].from_group(name, values[name])
            own, told = NODES[name].by_name(values[name])
            found.update(_common(own, name))
            remarks += told
    return found, remarks


def live_text(
    parameters: ReplayParameters, odom_frame: str, base_frame: str, chain: Optional[ThesisChain] = None
) -> str:
    values = live_values(parameters, odom_frame, base_frame, chain)
    return _COMMENT + yaml.safe_dump(values, sort_keys=False, allow_unicode=True)


def _common(values: Mapping[str, Any], node: str) -> Dict[str, Any]:
    """Return those of `values` that both the node and a replay know by the same name and meaning."""
    replayed = {field.name for field in fields(ReplayParameters)}
    names = [field.name for field in fields(_SHARED[node]) if field.name in replayed]
    return {name: values[name] for name in names if name in values}


ODOMETRY = "dead_reckoning"
CORRECTED = "corrected"


@dataclass(frozen=True)
class Replayed:
    """What came of a replay.

    times: (m,) s of the odometry. odometry, corrected: (m, 3) T_odom_base and T_map_base, the second as it was known
    at each moment. updates: of all scans that were taken, oldest first. refused: how many were not, by the reason.
    seconds: of a core for each scan. at_end: how well the place is known at the last of the times, where fixes ended
    two turns of the head or more before; else None.
    strafing: the run of a vehicle that strafes, which the scans may be as well; None where they tell that it does not,
    or nobody asked.
    """

    times: np.ndarray
    odometry: np.ndarray
    corrected: np.ndarray
    estimator: Estimator
    updates: List[ScanUpdate]
    refused: Mapping[str, int]
    seconds: List[float]
    at_end: Optional[PlaceNow]
    strafing: Optional[LiveSolver] = None

    @property
    def poses(self) -> Dict[str, np.ndarray]:
        """Both trajectories by the names that files and plots give them."""
        return {ODOMETRY: self.odometry, CORRECTED: self.corrected}

    @property
    def scans(self) -> List[Scan]:
        """All scans that were taken, oldest first."""
        return [update.scan for update in self.updates]

    @property
    def rivals(self) -> Optional[RivalSolvers]:
        """The joint solvers that have taken all scans; None where each was matched alone."""
        return None if self.estimator.session is None else self.estimator.session.rivals

    @property
    def solver(self) -> Optional[LiveSolver]:
        """The one of them that is believed."""
        return None if self.estimator.session is None else self.estimator.session.solver

    @property
    def silences(self) -> List[Tuple[float, float]]:
        """From when to when [s] no echo was heard, for more than a minute."""
        ends = [scan.reference_time for scan in self.scans if len(scan)]
        return [(begin, end) for begin, end in zip(ends[:-1], ends[1:]) if end - begin > _SILENT]

    @property
    def matched(self) -> int:
        return sum(update.accepted and update.result is not None for update in self.updates)

    @property
    def corrections(self) -> Optional[Track]:
        """T_map_odom at the ends of the scans, as known then; None where a scan has no belief."""
        if any(update.belief is None for update in self.updates):
            return None
        ends = np.array([update.scan.reference_time for update in self.updates])
        found = [move_of(one.scan.reference_pose, one.belief.theta[POSE]) for one in self.updates]
        return Track(ends, np.array(found))

    @property
    def found_again(self) -> List[str]:
        """How the vehicle was found again after silences of the sonar, a line for each."""
        start = self.times[0]
        return [f"{one.scan.reference_time - start:.0f} s: {one.found}" for one in self.updates if one.found]

    @property
    def rejected(self) -> int:
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
        needed = scan.reference_time + localiser.estimator.lookahead
        known = max(done, int(np.searchsorted(track.times, needed, side="left")))
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
    last = localiser.place_now(float(track.times[-1]), track.poses[-1])
    at_end = last if last is not None and last.overdue > 0.0 else None
    return Replayed(track.times, track.poses, corrected, localiser.estimator, updates, refused, seconds, at_end)


def _corrections(localiser: Localiser, track: Track, start: int, end: int) -> np.ndarray:
    """Return T_map_odom (end - start, 3) at the track's times from number `start` to before number `end`."""
    found = [localiser.following.correction(float(track.times[one]), track.poses[one]) for one in range(start, end)]
    return np.array(found).reshape(-1, 3)
