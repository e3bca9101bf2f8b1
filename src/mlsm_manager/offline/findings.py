"""What the joint solver found in a run besides the path: the calibration, and whether the run can be trusted."""

from dataclasses import dataclass, fields
from typing import Any, Dict, List, NamedTuple, Optional, Sequence, Tuple, Union

import numpy as np

from mlsm_manager.joint_solver.batch_solver import BatchResult, LoopClosure, PartResult, fit_of, solved_part
from mlsm_manager.joint_solver.estimate import LiveEstimate, Turns, expected_deviations
from mlsm_manager.joint_solver.live_solver import LiveSolver
from mlsm_manager.joint_solver.map_support import shares_heard_before
from mlsm_manager.joint_solver.normal_equations import HELD_DEVIATION, RUN_COLUMNS
from mlsm_manager.joint_solver.solution import Solution
from mlsm_manager.localisation.place_now import PlaceNow
from mlsm_manager.offline.refinement import Refined
from mlsm_manager.offline.replay import Replayed, ReplayParameters
from mlsm_manager.offline.trust import KnownPlaces, Trust, radii
from mlsm_manager.scan_matching.scan import Track
from mlsm_manager.scan_matching.scan_path import POSITION
from mlsm_manager.self_check.causes import CERTAIN, NOTHING_ASSUMED, UNTOLD_ALONE, Assumption, Cause, ranked, widened
from mlsm_manager.self_check.map_checks import in_submaps, recent_agreement, scans_go_on, surfaces_tell
from mlsm_manager.self_check.path_checks import (
    LARGEST_DEVIATION,
    against_odometry,
    as_expected,
    halves_agree,
    mount_told,
    odometry_decided,
    position_uncertainty,
)
from mlsm_manager.self_check.verdict import Verdict
from node_support.parameters import describe
from sonar_processing.beams.parameters import BeamCorrection

_FEWEST_SCANS = 20  # a window's worth: fewer say too little of scale and delay
_OF_RUN = ("range_scale_error", "sonar_delay")  # as the solver's unknowns of the run are ordered


@dataclass(frozen=True)
class Calibration:
    """names, values, deviations: (n,) what was found. range_scale_error: true range over reported range minus 1.

    sonar_delay: s by which beams are later than their stamps. odometry_scale: true distance over reported distance
    minus 1, odometry_direction: rad from reported to true motion, both where the odometry reports distances.
    """

    names: Tuple[str, ...]
    values: np.ndarray
    deviations: np.ndarray

    @classmethod
    def expected(cls, solver: LiveSolver) -> "Calibration":
        odometry, parameters = solver.odometry, solver.parameters
        columns = list(odometry.calibrated.values())
        deviations = np.append(parameters.run_deviations(solver.log), odometry.first_deviations()[columns])
        values = np.append(parameters.run_mean(solver.log), odometry.first_node()[columns])
        return cls((*_OF_RUN, *odometry.calibrated), values, np.maximum(deviations, HELD_DEVIATION))

    @classmethod
    def found(
        cls, solver: LiveSolver, known: Union[LiveEstimate, PartResult], batch: Optional[BatchResult] = None
    ) -> "Calibration":
        """Return what an estimate during a run, or the fit of a part of it, knows, or the fit of the whole run found.

        batch: that fit; scale and direction are those of the last node, whose variances `known`, the last estimate,
        tells. A range scale that the run could not tell is as uncertain as before.
        """
        of_node, calibrated = np.diag(known.covariance), solver.odometry.calibrated
        run, node, of_run = known.run, known.node, of_node[-RUN_COLUMNS:]
        if batch is not None:
            run, node, of_run = batch.state.run, batch.state.nodes[-1], np.diag(batch.run_covariance)
        columns = list(calibrated.values())
        deviations = np.sqrt(np.append(of_run, of_node[columns]))
        deviations[0] = np.hypot(deviations[0], solver.parameters.world_scale_deviation(solver.log))
        return cls((*_OF_RUN, *calibrated), np.append(run, node[columns]), deviations)

    @property
    def by_name(self) -> Dict[str, Tuple[float, float]]:
        """Value and deviation of each of `names`."""
        return {name: (float(value), float(own)) for name, value, own in zip(self.names, self.values, self.deviations)}

    def to_mapping(self) -> Dict[str, Any]:
        """Return values and deviations by name, rounded for people."""
        return {
            name: {"value": round(value, 5), "deviation": round(deviation, 5)}
            for name, (value, deviation) in self.by_name.items()
        }

    def applied(self, parameters: ReplayParameters) -> ReplayParameters:
        """Return `parameters` with what was found as what is known before the next run, in the sonar's own terms."""
        before, value = parameters.part(BeamCorrection), {name: value for name, (value, _) in self.by_name.items()}
        value["range_scale"] = before.range_scale * (1.0 + value.pop("range_scale_error"))
        value["sonar_delay"] = before.sonar_delay + value["sonar_delay"]
        value["range_scale_deviation"], value["sonar_delay_deviation"] = self.deviations[:2].tolist()
        value["plateau_scale_deviation"] = value["plateau_scale_error"] = 0.0
        # Within their ranges, so that a run that went astray has a live.yaml too.
        ranges = {field.name: describe(field) for field in fields(ReplayParameters) if field.name in value}
        return parameters.changed(
            {name: float(np.clip(one, ranges[name].low, ranges[name].high)) for name, one in value.items()}
        )


class BestPath(NamedTuple):
    """A path as well as a run knows it. poses: (m, 3) T_map_base at the times of the replay. solution: of the solver.

    times: (k,) s of its nodes, with places (k, 2) [m], covariances (k, 2, 2) [m^2], and deviations (k,) [m] that are
    expected whatever the water tells. mounts: rad, by how much the sonar may be turned where no course tells it.
    """

    poses: np.ndarray
    solution: Solution
    times: np.ndarray
    places: np.ndarray
    covariances: np.ndarray
    expected: np.ndarray
    mounts: float = 0.0

    def to_the_end(self, end: Optional[PlaceNow], newest: np.ndarray) -> "BestPath":
        """Return it with its last place too, where fixes ended long before.

        end: see Replayed.at_end. newest: (2, 2) m^2, how well the place of the last scan was known.
        """
        if end is None:
            return self
        # Scans that told nothing may have made the place before them less certain than the live one is at the end.
        values, axes = np.linalg.eigh(end.covariance[POSITION, POSITION] - newest)
        covariance = self.covariances[-1] + (np.maximum(values, 0.0) * axes) @ axes.T
        return self._replace(
            times=np.append(self.times, end.time),
            places=np.append(self.places, self.poses[-1:, :2], axis=0),
            covariances=np.append(self.covariances, covariance[np.newaxis], axis=0),
            expected=np.append(self.expected, self.expected[-1]),
        )

    def causes_of_silence(self, silences: Sequence[Tuple[float, float]], end: Optional[PlaceNow]) -> List[Cause]:
        """Return when nothing was heard for so long that the position was lost, the longest time, and at the end.

        In mid-run it ranks last, as another cause may explain it; at the end it ranks first.

        silences, end: see Replayed.silences and at_end.
        """
        longest = max((one for one in silences if self._is_lost_between(*one)), key=np.ptp, default=None)
        causes = [] if longest is None else [Cause(f"no echo came for {np.ptp(longest):.0f} s,", 0.0, longest[0])]
        if end is not None and self._is_lost_between(end.time - end.age, end.time):
            text = f"the last fix came {end.age:.0f} s before the end,"
            causes.append(Cause(text, CERTAIN, end.time - end.age))
        return causes

    def _is_lost_between(self, begin: float, end: float) -> bool:
        """Return whether the position grows uncertain by more than 5 m between two times [s]."""
        deviations = radii(self.covariances)
        between = deviations[slice(*np.searchsorted(self.times, [begin, end], side="right"))]
        before = np.interp(begin, self.times, deviations)
        return bool(np.sqrt(max(between.max(initial=0.0) ** 2 - before**2, 0.0)) > LARGEST_DEVIATION)


def _live_path(replayed: Replayed) -> BestPath:
    solver, strafing = replayed.solver, replayed.strafing
    known, expected = _known_live(solver), solver.expected_deviations(solver.estimates)
    known = known if strafing is None else known.or_on(_known_live(strafing))
    return BestPath(replayed.corrected, solver.solution, *known, expected)


def _known_live(solver: LiveSolver) -> KnownPlaces:
    told = ((one.time, one.T_map_base[:2], one.pose_covariance[:2, :2]) for one in solver.estimates)
    return KnownPlaces(*(np.array(ones) for ones in zip(*told)))


def _refined_path(refined: Refined, replayed: Replayed) -> BestPath:
    solver, strafing = replayed.solver, replayed.strafing
    known = _known_by(refined.motion.fit, refined.motion.run)
    lengths = np.full(len(known.times), solver.estimates[-1].length_deviation)
    directions = float(np.hypot(solver.heading_deviation, refined.motion.mounts))
    expected = expected_deviations(known.places - known.places[0], lengths, directions)
    known = known._replace(covariances=known.covariances + refined.motion.spread(known.times))
    # One fit takes a second, a search for the best path minutes. On unbroken tours both state the same within 2 %.
    known = known if strafing is None else known.or_on(_known_by(fit_of(strafing.solution), strafing.solution))
    return BestPath(refined.poses, refined.motion.run, *known, expected, refined.motion.mounts)


def _known_by(fit: BatchResult, run: Solution) -> KnownPlaces:
    places = run.with_state(fit.state).places
    return KnownPlaces(fit.node_times, places, fit.pose_covariances[:, :2, :2])


def _checks(replayed: Replayed, best: BestPath, calibration: Calibration) -> List[Verdict]:
    solver = replayed.solver
    parts, apart = solver.parameters.parts_per_turn, solver.submaps.apart
    turns = Turns.of(solver.estimates, apart, parts)
    heard = Turns.with_echoes(solver.estimates, apart, parts, solver.log.surfaces.counts, solver.log.scan_count)
    start, before = float(solver.log.node_times[0]), Calibration.expected(solver)
    if np.isinf(solver.odometry.distance_deviation):
        # The odometry reports no distances: scans are compared with those before them instead.
        motion = (scans_go_on(turns.times, shares_heard_before(best.solution, 0)),)
    else:
        motion = against_odometry(
            replayed.times, replayed.odometry, best.poses,
            scale_deviation=solver.odometry.distance_deviation, position_walk=solver.odometry.position_walk,
        )  # fmt: skip
    return [
        *motion,
        recent_agreement(heard.times, heard.agreements),
        position_uncertainty(best.times, radii(best.covariances), best.expected),
        *surfaces_tell(start, turns.times, turns.surfaces, solver.distance_deviation),
        *in_submaps(turns.times, turns.apart),
        as_expected(before.names, before.values, before.deviations, calibration.values),
        *_halves(solver),
        *mount_told(best.mounts),
        *odometry_decided(replayed.rivals.doubt),
    ]


def _trust(
    replayed: Replayed, best: BestPath, verdicts: List[Verdict], causes: Sequence[Cause], assumed: Assumption
) -> Trust:
    """Return how far a path can be trusted, with what causes add to what is stated."""
    reported = Track(replayed.times, replayed.odometry).at(best.times)[:, :2]
    # A path that went astray may be far too short, and an odometry without positions has none.
    ways = max((best.places, reported), key=lambda path: float(np.ptp(path, axis=0).max()))
    covariances = widened(best.covariances, best.times, ways, causes)
    is_alone = np.isinf(replayed.solver.odometry.distance_deviation) and np.ptp(replayed.odometry[:, 2]) > 0.0
    untold = UNTOLD_ALONE if is_alone else ""
    return Trust(verdicts, best.times, covariances, replayed.matched, causes, untold=untold).assuming(assumed, ways)


def _halves(solver: LiveSolver) -> Tuple[Verdict, ...]:
    """Compare the calibration of each half of the run, made without the other one.

    What was known after the first half came from that half alone; the second is fitted anew.
    """
    parts = solver.parameters.parts_per_turn
    middle = solver.log.scan_count // parts // 2
    if middle < _FEWEST_SCANS:
        return ()
    first = Calibration.found(solver, solver.estimates[middle * parts - 1])
    second = Calibration.found(solver, solved_part(solver, middle * parts))
    return (halves_agree(first.names, first.values, first.deviations, second.values, second.deviations),)


@dataclass(frozen=True)
class Findings:
    """calibration, trust: of the fit of the whole run where there is one. closing: which places it goes back to."""

    calibration: Calibration
    trust: Trust
    closing: Optional[LoopClosure] = None

    @classmethod
    def of(
        cls, replayed: Replayed, refined: Optional[Refined], further: Sequence[Verdict], causes: Sequence[Cause],
        assumed: Assumption = NOTHING_ASSUMED,
    ) -> "Findings":  # fmt: skip
        """Return what was found in a run that the joint solver has followed.

        further: what other checks say. causes: of what is wrong. assumed: what nobody measured and the path
        rests on, if anything.
        """
        solver = replayed.solver
        batch = None if refined is None else refined.motion.fit
        calibration = Calibration.found(solver, solver.estimates[-1], batch)
        best = _live_path(replayed) if refined is None else _refined_path(refined, replayed)
        best = best.to_the_end(replayed.at_end, solver.estimates[-1].pose_covariance[POSITION, POSITION])
        verdicts = [*_checks(replayed, best, calibration), *further]
        causes = ranked([*causes, *best.causes_of_silence(replayed.silences, replayed.at_end)])
        trust = _trust(replayed, best, verdicts, causes, assumed)
        return cls(calibration, trust, None if refined is None else refined.closing)

    def to_mapping(self) -> Dict[str, Any]:
        loops = {} if self.closing is None else {"loops": self.closing.to_mapping()}
        calibration = self.calibration.to_mapping()
        return {"calibration": calibration, **self.trust.to_mapping(), **loops, "trust": self.trust.line}
