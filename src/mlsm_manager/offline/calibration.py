"""What a run found out about its sonar and its odometry."""

from dataclasses import dataclass, fields
from typing import Any, Dict, Tuple

import numpy as np

from mlsm_manager.joint_solver.motion.motion_models import HELD_DEVIATION
from mlsm_manager.joint_solver.placing.estimate import LiveEstimate
from mlsm_manager.joint_solver.solve.batch_solver import BatchResult, PartResult
from mlsm_manager.joint_solver.solve.live_solver import LiveSolver
from mlsm_manager.joint_solver.unknowns.state import DELAY, RANGE_SCALE, RUN_COLUMNS
from mlsm_manager.offline.replay_parameters import ReplayParameters
from node_support.parameters import describe
from sonar_processing.beams.parameters import BeamCorrection

_OF_RUN = {"range_scale": RANGE_SCALE, "sonar_delay": DELAY}


@dataclass(frozen=True)
class Calibration:
    """names, values, deviations: (n,) what was found. range_scale: true range over reported range minus 1.

    sonar_delay: s by which beams are later than their stamps. odometry_scale: true distance over reported distance
    minus 1, odometry_direction: rad from reported to true motion, both where the odometry reports distances.
    """

    names: Tuple[str, ...]
    values: np.ndarray
    deviations: np.ndarray

    @classmethod
    def expected(cls, solver: LiveSolver) -> "Calibration":
        """Return what was known before the run."""
        columns, parameters = solver.odometry.calibrated, solver.parameters
        of_node = list(columns.values())
        values = np.append(parameters.run_mean, solver.odometry.first_node()[of_node])
        deviations = np.append(parameters.run_deviations, solver.odometry.first_deviations()[of_node])
        deviations = np.maximum(deviations, HELD_DEVIATION)
        return cls((*_OF_RUN, *columns), values, deviations)

    @classmethod
    def of_live(cls, solver: LiveSolver) -> "Calibration":
        """Return what the newest estimate of a run knows; the solver must have taken a scan."""
        return cls.of_estimate(solver, solver.estimates[-1])

    @classmethod
    def of_estimate(cls, solver: LiveSolver, estimate: LiveEstimate) -> "Calibration":
        """Return what one of the estimates of `solver` knows."""
        columns = solver.odometry.calibrated
        of_node, of_run = list(columns.values()), list(_OF_RUN.values())
        of_nodes = np.sqrt(np.diag(estimate.covariance)[of_node])
        deviations = np.append(_of_run(estimate.run_deviations, solver), of_nodes)
        return cls((*_OF_RUN, *columns), np.append(estimate.run[of_run], estimate.node[of_node]), deviations)

    @classmethod
    def of_batch(cls, solver: LiveSolver, batch: BatchResult) -> "Calibration":
        """Return what the fit of a whole run found; scale and direction are those of the last node."""
        live, of_run = cls.of_live(solver), list(_OF_RUN.values())
        deviations = _of_run(np.sqrt(np.diag(batch.run_covariance)), solver)
        values = np.append(batch.state.run[of_run], batch.state.nodes[-1, list(solver.odometry.calibrated.values())])
        return cls(live.names, values, np.append(deviations, live.deviations[len(of_run) :]))

    @classmethod
    def of_part(cls, solver: LiveSolver, part: PartResult) -> "Calibration":
        """Return what the fit of a part of a run found; scale and direction are those of the last node."""
        columns, of_run = solver.odometry.calibrated, list(_OF_RUN.values())
        deviations, of_node = np.sqrt(np.diag(part.covariance)), list(columns.values())
        known = np.append(_of_run(deviations[-RUN_COLUMNS:], solver), deviations[of_node])
        return cls((*_OF_RUN, *columns), np.append(part.run[of_run], part.node[of_node]), known)

    @property
    def by_name(self) -> Dict[str, Tuple[float, float]]:
        """Value and deviation of each of `names`."""
        return {name: (float(value), float(own)) for name, value, own in zip(self.names, self.values, self.deviations)}

    def to_mapping(self) -> Dict[str, Any]:
        """Return values and deviations by name, rounded for people."""
        return {
            name: {"value": round(float(value), 5), "deviation": round(float(deviation), 5)}
            for name, value, deviation in zip(self.names, self.values, self.deviations)
        }

    def applied(self, parameters: ReplayParameters) -> ReplayParameters:
        """Return `parameters` with what was found as what is known before the next run, in the sonar's own terms."""
        value = dict(zip(self.names, self.values.tolist()))
        deviation = dict(zip(self.names, self.deviations.tolist()))
        before = parameters.part(BeamCorrection)
        value["range_scale"] = before.range_scale * (1.0 + value["range_scale"])
        value["sonar_delay"] = before.sonar_delay + value["sonar_delay"]
        found = {**value, **{f"{name}_deviation": deviation[name] for name in _OF_RUN}}
        return parameters.changed(_allowed(found))


def _of_run(deviations: np.ndarray, solver: LiveSolver) -> np.ndarray:
    """Return deviations (2,) as _OF_RUN; a range scale that the run could not tell is as uncertain as before."""
    result = deviations[list(_OF_RUN.values())].copy()
    result[0] = np.hypot(result[0], solver.parameters.world_scale_deviation)
    return result


def _allowed(values: Dict[str, float]) -> Dict[str, float]:
    """Return `values` within their ranges, so that a run that went astray can still be told."""
    ranges = {field.name: describe(field) for field in fields(ReplayParameters) if field.name in values}
    return {name: float(np.clip(value, ranges[name].low, ranges[name].high)) for name, value in values.items()}
