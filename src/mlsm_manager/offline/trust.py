"""Whether a run can be trusted, told without any truth: the checks of map_bag."""

from dataclasses import dataclass
from typing import Any, Dict, List, Optional, Sequence, Tuple

import numpy as np

from mlsm_manager.joint_solver.compare.map_support import shares_heard_before
from mlsm_manager.joint_solver.motion.motion_models import OdometryModel
from mlsm_manager.joint_solver.placing.turns import Turns
from mlsm_manager.joint_solver.solve.batch_solver import solved_part
from mlsm_manager.joint_solver.solve.live_solver import LiveSolver
from mlsm_manager.joint_solver.unknowns.state import State
from mlsm_manager.offline.calibration import Calibration
from mlsm_manager.offline.refinement import Refined
from mlsm_manager.offline.replay import Replayed
from mlsm_manager.self_check.map_checks import in_one_map, recent_agreement, scans_go_on, surfaces_tell
from mlsm_manager.self_check.path_checks import (
    against_odometry,
    as_expected,
    halves_agree,
    per_minute,
    position_uncertainty,
)
from mlsm_manager.self_check.verdict import Verdict

# A window's worth of scans: fewer say too little of scale and delay.
_FEWEST_SCANS = 20


@dataclass(frozen=True)
class Deviations:
    """How certain the path is. times: (k,) s. covariances: (k, 2, 2) m^2 of the position in map."""

    times: np.ndarray
    covariances: np.ndarray

    @property
    def radii(self) -> np.ndarray:
        """(k,) m, root of the sum of both variances."""
        return np.sqrt(np.trace(self.covariances, axis1=1, axis2=2))


@dataclass(frozen=True)
class Trust:
    """verdicts: of all checks. deviations: of the path that is told."""

    verdicts: List[Verdict]
    deviations: Deviations

    @property
    def line(self) -> str:
        """One line for people."""
        firing = [verdict for verdict in self.verdicts if verdict.fires]
        if not firing:
            return f"trust: all {len(self.verdicts)} checks are fine"
        return "trust: DOUBTFUL: " + "; ".join(verdict.text for verdict in firing)

    @property
    def doubtful(self) -> np.ndarray:
        """(k, 2) s, beginnings and ends of the stretches that made a check fire."""
        return np.concatenate([np.empty((0, 2)), *(v.doubtful for v in self.verdicts if v.fires)])

    def to_mapping(self) -> Dict[str, Any]:
        """Return the checks and the deviation per minute for summary.json."""
        checks = {
            verdict.name: {
                "value": None if np.isnan(verdict.value) else round(verdict.value, 3),
                "limit": verdict.limit,
                "fires": verdict.fires,
                "meaning": verdict.text,
            }
            for verdict in self.verdicts
        }
        minutes = per_minute(self.deviations.times, self.deviations.radii)
        told = [None if np.isnan(value) else round(float(value), 2) for value in minutes]
        return {"checks": checks, "deviation_per_minute": told}


def trust(replayed: Replayed, refined: Optional[Refined], further: Sequence[Verdict] = ()) -> Trust:
    """Return what the checks say of a run of the joint solver; of the refined path where there is one.

    further: what other checks say.
    """
    solver = replayed.solver
    parts, apart = solver.parameters.parts_per_turn, solver.islands.apart
    turns = Turns.of(solver.estimates, apart, parts)
    heard = Turns.with_echoes(solver.estimates, apart, parts, solver.log.point_counts, solver.log.scan_count)
    path = replayed.corrected if refined is None else refined.poses
    deviations = _live_deviations(solver) if refined is None else _batch_deviations(refined)
    verdicts = [
        *_against_odometry(replayed, path, solver.odometry),
        *_going_on(solver, solver.state if refined is None else refined.batch.state, turns.times),
        recent_agreement(heard.times, heard.agreements),
        position_uncertainty(deviations.times, deviations.radii),
        *surfaces_tell(
            float(solver.log.node_times[0]),
            turns.times,
            turns.surfaces,
            solver.odometry.distance_deviation,
        ),
        *in_one_map(turns.times, turns.apart),
    ]
    found = Calibration.of_live(solver) if refined is None else Calibration.of_batch(solver, refined.batch)
    before = Calibration.expected(solver)
    verdicts.append(as_expected(before.names, before.values, before.deviations, found.values))
    halves = _halves(solver)
    verdicts += [] if halves is None else [halves]
    return Trust([*verdicts, *further], deviations)


def _against_odometry(replayed: Replayed, path: np.ndarray, odometry: OdometryModel) -> Tuple[Verdict, ...]:
    """Compare a path (m, 3) with the odometry's; nothing where that reports no distances."""
    if np.isinf(odometry.distance_deviation):
        return ()
    return against_odometry(
        replayed.times, replayed.odometry, path,
        scale_deviation=odometry.distance_deviation, position_walk=odometry.position_walk,
    )  # fmt: skip


def _going_on(solver: LiveSolver, state: State, ends: np.ndarray) -> Tuple[Verdict, ...]:
    """Ask whether scans lie on those before them, where the motion between them is unknown."""
    if not np.isinf(solver.odometry.distance_deviation):
        return ()
    shares = shares_heard_before(solver.log, solver.odometry, state, solver.parameters, 0)
    return (scans_go_on(ends, shares),)


def _live_deviations(solver: LiveSolver) -> Deviations:
    covariances = [estimate.pose_covariance[:2, :2] for estimate in solver.estimates]
    return Deviations(np.array([estimate.time for estimate in solver.estimates]), np.array(covariances))


def _batch_deviations(refined: Refined) -> Deviations:
    return Deviations(refined.batch.node_times, refined.batch.pose_covariances[:, :2, :2])


def _halves(solver: LiveSolver) -> Optional[Verdict]:
    """Compare the calibration of each half of the run, made without the other one.

    What was known after the first half came from that half alone; the second is fitted anew.
    """
    parts = solver.parameters.parts_per_turn
    middle = solver.log.scan_count // parts // 2
    if middle < _FEWEST_SCANS:
        return None
    first = Calibration.of_estimate(solver, solver.estimates[middle * parts - 1])
    second = Calibration.of_part(solver, solved_part(solver, middle * parts))
    return halves_agree(first.names, first.values, first.deviations, second.values, second.deviations)
