"""What is believed of the unknowns before any comparison."""

import numpy as np

from mlsm_manager.multi_view.parameters import SonarCalibration
from mlsm_manager.multi_view.unknowns.normal_equations import NormalEquations

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
