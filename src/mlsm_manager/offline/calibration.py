"""What a run found out about its sonar and its odometry."""

from dataclasses import dataclass, fields
from typing import Any, Dict, Tuple

import numpy as np

from mlsm_manager.multi_view.batch_solver import BatchResult
from mlsm_manager.multi_view.live_solver import LiveSolver
from mlsm_manager.multi_view.state import DELAY, DIRECTION, RANGE_SCALE, SCALE
from mlsm_manager.offline.replay_parameters import ReplayParameters
from node_support.parameters import describe
from sonar_processing.beams.beam_correction import BeamCorrection

NAMES = ("range_scale", "sonar_delay", "odometry_scale", "odometry_direction")


@dataclass(frozen=True)
class Calibration:
    """values, deviations: (4,) as NAMES: true range over reported range minus 1; s by which beams are later than
    their stamps; true distance over reported distance minus 1; rad from reported to true motion.
    """

    values: np.ndarray
    deviations: np.ndarray

    @classmethod
    def of_live(cls, solver: LiveSolver) -> "Calibration":
        """Return what the newest estimate of a run knows; the solver must have taken a scan."""
        newest = solver.estimates[-1]
        deviations = newest.run_deviations[[RANGE_SCALE, DELAY]], newest.node_deviations[[SCALE, DIRECTION]]
        return cls(
            np.append(newest.run[[RANGE_SCALE, DELAY]], newest.node[[SCALE, DIRECTION]]), np.concatenate(deviations)
        )

    @classmethod
    def of_batch(cls, solver: LiveSolver, batch: BatchResult) -> "Calibration":
        """Return what the fit of a whole run found; scale and direction are those of the last node."""
        of_run = np.sqrt(np.diag(batch.run_covariance))[[RANGE_SCALE, DELAY]]
        of_odometry = cls.of_live(solver).deviations[2:]
        values = np.append(batch.state.run[[RANGE_SCALE, DELAY]], batch.state.nodes[-1, [SCALE, DIRECTION]])
        return cls(values, np.concatenate([of_run, of_odometry]))

    @property
    def by_name(self) -> Dict[str, Tuple[float, float]]:
        """Value and deviation of each of NAMES."""
        return {name: (float(value), float(own)) for name, value, own in zip(NAMES, self.values, self.deviations)}

    def to_mapping(self) -> Dict[str, Any]:
        """Return values and deviations by name, rounded for people."""
        return {
            name: {"value": round(float(value), 5), "deviation": round(float(deviation), 5)}
            for name, value, deviation in zip(NAMES, self.values, self.deviations)
        }

    def applied(self, parameters: ReplayParameters) -> ReplayParameters:
        """Return `parameters` with what was found as what is known before the next run, in the sonar's own terms."""
        ranges, delay, scale, direction = (float(value) for value in self.values)
        before = parameters.part(BeamCorrection)
        found = {
            "range_scale": before.range_scale * (1.0 + ranges),
            "sonar_delay": before.sonar_delay + delay,
            "range_scale_deviation": float(self.deviations[0]),
            "sonar_delay_deviation": float(self.deviations[1]),
            "odometry_scale": scale,
            "odometry_direction": direction,
        }
        return parameters.changed(_allowed(found))


def _allowed(values: Dict[str, float]) -> Dict[str, float]:
    """Return `values` within their ranges, so that a run that went astray can still be told."""
    ranges = {field.name: describe(field) for field in fields(ReplayParameters) if field.name in values}
    return {name: float(np.clip(value, ranges[name].low, ranges[name].high)) for name, value in values.items()}
