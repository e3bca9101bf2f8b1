"""What is believed of the unknowns before any comparison."""

import numpy as np

from mlsm_manager.joint_solver.parameters import SonarCalibration
from mlsm_manager.joint_solver.unknowns.normal_equations import NormalEquations
from mlsm_manager.joint_solver.unknowns.state import Layout

_HELD_DEVIATION = 1e-6  # stands for a deviation of zero


def add_belief(
    equations: NormalEquations, start: int, value: np.ndarray, mean: np.ndarray, deviation: np.ndarray
) -> None:
    """Add that the unknowns from column `start` on, now at `value` (m,), are `mean` (m,) but for `deviation` (m,)."""
    columns = start + np.arange(len(value))[:, np.newaxis]
    weight = np.maximum(deviation, _HELD_DEVIATION) ** -2.0
    equations.add(columns, np.ones((len(value), 1)), value - mean, weight)


def run_mean(sonar: SonarCalibration) -> np.ndarray:
    """Return the run's unknowns (2,) as expected before the run."""
    return np.array([sonar.range_scale, sonar.sonar_delay])


def run_deviations(sonar: SonarCalibration) -> np.ndarray:
    """Return their standard deviations (2,)."""
    return np.array([sonar.range_scale_deviation, sonar.sonar_delay_deviation])


def add_told_steps(
    equations: NormalEquations, layout: Layout, places: np.ndarray, told: np.ndarray, deviation: float
) -> None:
    """Add that steps between all nodes, now at `places` (n, 2) [m] in map, are those of the path `told` (n, 2).

    deviation: m, of each step in each direction.
    """
    count = len(places) - 1
    columns = layout.pose_columns(np.column_stack([np.arange(count), np.arange(count) + 1]))
    errors = np.diff(places - told, axis=0)
    for axis in (0, 1):
        jacobian = np.tile([-1.0, 1.0], (count, 1))
        equations.add(columns[:, :, axis], jacobian, errors[:, axis], np.full(count, deviation**-2.0))
