"""Whether the sonar's ranges and the odometry's distances agree: where not, nothing in a run tells which are wrong."""

from typing import List

import numpy as np

from mlsm_manager.joint_solver.motion_models import SCALE
from mlsm_manager.joint_solver.normal_equations import HELD_DEVIATION, RANGE_SCALE
from mlsm_manager.joint_solver.solution import Solution
from mlsm_manager.odometry.faults import FaultKind, MotionFault
from mlsm_manager.self_check.causes import NOTHING_ASSUMED, Assumption, Cause, unsure_length

_SHORTEST = 0.05  # true over reported distances: a fit of what makes no sense may go back, and tells no length
_ODD_LENGTH = np.log(1.2)  # a sonar's ranges and a DVL's distances are right to some percent
_UNLIKELY_LENGTH = np.log(1.7)  # thrusters err by a third; sonars set to half or twice the range, and feet, by more
_ODD_RANGES = 1.0  # deviations of what was known of the ranges: beyond, a DVL's distances are wrong as often as these


def length_causes(run: Solution) -> List[Cause]:
    """Return that distances or ranges are wrong, where they contradict each other by more than any thrusters err."""
    length, usual = _odometry_length(run), run.parameters.odometry.distance_deviation
    if abs(length) <= _UNLIKELY_LENGTH:
        return []
    fault = MotionFault(FaultKind.LENGTH, np.nan, (length,))
    return [Cause(fault.text, 0.5 * (length / usual) ** 2, length=unsure_length(length))]


def assumed_of_lengths(run: Solution) -> Assumption:
    """Return which of both a run took for right, where they contradict each other clearly.

    Nobody knows the odometry of a run whose model has a rival.
    """
    length = _odometry_length(run)
    if abs(length) < _ODD_LENGTH or run.parameters.odometry.rival is None:
        return assumed_of_distances(run)
    text = f"the sonar's ranges are right, although the odometry's distances are {np.exp(-length):.2f} times as long"
    return Assumption(f"{text} (name the odometry to decide)", 0.0, unsure_length(length))


def assumed_of_distances(run: Solution) -> Assumption:
    """Return that a run took its odometry's distances for right, where the ranges contradict them clearly."""
    ranges = _range_length(run)
    if not ranges:
        return NOTHING_ASSUMED
    text = f"the odometry's distances are right, although the sonar's ranges are {np.exp(-ranges):.2f} times as long"
    return Assumption(f"{text} (measure a known distance to decide)", 0.0, unsure_length(ranges))


def _odometry_length(run: Solution) -> float:
    """Return the logarithm of true distances over reported ones, as a run found it; zero where it tells none."""
    model = run.parameters.odometry
    if SCALE not in model.calibrated.values():
        return 0.0
    found, expected = (1.0 + node[SCALE] for node in (run.state.nodes[-1], model.first_node()))
    return float(np.log(found / expected)) if found > _SHORTEST else 0.0


def _range_length(run: Solution) -> float:
    """Return the logarithm of true ranges over those that were expected, as a run found it; zero where it is usual."""
    log, parameters = run.log, run.parameters
    found, expected = (1.0 + values[RANGE_SCALE] for values in (run.state.run, parameters.run_mean(log)))
    usual = max(parameters.run_deviations(log)[RANGE_SCALE], HELD_DEVIATION)
    length = float(np.log(max(found, _SHORTEST) / expected))
    return length if abs(length) > _ODD_RANGES * usual else 0.0
