"""Motion models of small vehicles, and parameters of the joint solver with a DVL."""

from dataclasses import replace

import numpy as np
from made_harbour import SONAR_IN_BASE

from mlsm_manager.joint_solver.live_solver import LiveSolver
from mlsm_manager.joint_solver.motion_models import Compass
from mlsm_manager.joint_solver.normal_equations import State
from mlsm_manager.joint_solver.parameters import SolverParameters
from mlsm_manager.joint_solver.placement import PlacedPoints
from mlsm_manager.joint_solver.position_models import DvlFactors, PositionOdometry, ThrusterFactors
from mlsm_manager.joint_solver.run_log import RunLog
from mlsm_manager.joint_solver.solution import Solution
from mlsm_manager.joint_solver.velocity_models import HeadingFactors, Speeds, UnaidedFactors

COMPASS = Compass(heading_deviation=0.01745, heading_correlation_time=300.0, heading_walk=0.00035)
DVL_ODOMETRY = PositionOdometry(
    COMPASS, position_walk=0.12, direction=0.0, direction_deviation=0.105, direction_walk=0.0014, scale=0.0,
    scale_deviation=0.01,
)  # fmt: skip
THRUSTER_ODOMETRY = replace(
    DVL_ODOMETRY, scale_deviation=0.3, scale_walk=0.005, current_deviation=0.05, current_walk=0.002
)
SPEEDS = Speeds(
    start_speed_deviation=0.3, speed_deviation=0.1, speed_correlation_time=40.0, travel_walk=0.005,
    slip_deviation=0.05, slip_correlation_time=20.0,
)  # fmt: skip

DVL, THRUSTERS = DvlFactors(DVL_ODOMETRY), ThrusterFactors(THRUSTER_ODOMETRY)
HEADING = HeadingFactors(SPEEDS, COMPASS)
UNAIDED = UnaidedFactors(SPEEDS, deviation=0.05, correlation_time=10.0, heading_walk=0.00035)


def solver_parameters(**values):
    """Return parameters of the joint solver with `values` of some, and the model of a DVL unless another is given."""
    return SolverParameters(**{"odometry": DVL, **values})


def followed(scans, parameters=None, sonar_in_base=SONAR_IN_BASE):
    """Return the live solver after `scans`, by default of a vehicle with a DVL whose beams may be late."""
    solver = LiveSolver(parameters or solver_parameters(sonar_delay_deviation=1.0), RunLog(sonar_in_base))
    for scan in scans:
        solver.add(scan)
    return solver


def errors_of(solver, made):
    """Return by how much (n, 3) the live path is off the truth of a tour at the scans' ends, [m] and [rad]."""
    ends = np.array([estimate.time for estimate in solver.estimates])
    truth = made.truth.at(ends) - made.truth.at(0.0) * [1.0, 1.0, 0.0]
    path = np.array([estimate.T_map_base for estimate in solver.estimates])
    return path - solver.log.node_poses(np.array([0])) * [1.0, 1.0, 0.0] - truth


def solution_of(log, odometry, state):
    """Return a run whose unknowns are `state`."""
    return Solution(log, solver_parameters(odometry=odometry), state)


def some_state(log, odometry=DVL, delay=0.3):
    """Return unknowns of a run that are drawn at random."""
    nodes = np.random.RandomState(1).normal(0.0, 0.2, (log.scan_count + 1, odometry.width))
    return State(nodes, np.array([0.01, delay]))


def points_of(scans, **columns):
    """Return points of `scans` (n,) heard at (0, 0) with each node's own pose, but for `columns`."""
    count = len(scans)
    one, two = np.zeros(count), np.zeros((count, 2))
    return replace(PlacedPoints(scans, two, two, two, one, np.ones(count), one, np.zeros((count, 2, 2))), **columns)
