"""Whether a vehicle with a compass alone stops and strafes, told from how its echoes agree."""

from typing import Optional

import numpy as np

from mlsm_manager.joint_solver.judge.continuity import shares_heard_before
from mlsm_manager.joint_solver.placing.path import NodePath
from mlsm_manager.joint_solver.shifting.echo_agreement import agreement
from mlsm_manager.joint_solver.solve.live_solver import LiveSolver
from mlsm_manager.joint_solver.ways.way_echoes import WayEchoes
from mlsm_manager.self_check.continuity import scans_go_on

_WORTH_TRYING = 0.75
"""Share of scans that go on, below which a second mapping is worth its time. Simulated tours ahead have 0.85 and more,
strafing ones 0.57 and 0.66."""
_CLEARLY = 1.05  # times the agreement: 1.01 on tours ahead, where the wider profile fits noise; 1.25 and more on others


def may_strafe(ahead: Optional[LiveSolver]) -> bool:
    """Return whether scans do not go on in the run of a solver that expects the vehicle to go ahead."""
    if ahead is None:
        return False
    shares = shares_heard_before(ahead.log, ahead.odometry, ahead.state, ahead.parameters.matching, 0)
    return scans_go_on(ahead.log.node_times[1:], shares, _WORTH_TRYING).fires


def strafes(ahead: LiveSolver, strafing: LiveSolver) -> bool:
    """Return whether echoes clearly speak more for the run of a solver that expects strafing, of the same scans."""
    times = strafing.log.node_times
    echoes = WayEchoes.of_run(strafing.log, strafing.odometry, strafing.parameters)
    one, other = (agreement(echoes, _path(solver, times)) for solver in (ahead, strafing))
    return other > _CLEARLY * one


def _path(solver: LiveSolver, times: np.ndarray) -> np.ndarray:
    nodes = NodePath(solver.odometry, solver.log.odometry, solver.log.node_times, solver.state.nodes)
    return nodes.at(times)[:, :2]
