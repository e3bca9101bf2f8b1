"""Weighs ways by what they heard, those that end near each other together.

What a source may lie on is looked for around the mean of some ways. Were all of them taken together, echoes of the
few that end far from the others would be compared with nothing, and such ways would die out.
"""

from typing import List

import numpy as np

from mlsm_manager.joint_solver.solver_kernel import SolverKernel
from mlsm_manager.joint_solver.ways.way_comparisons import nats_among, nearby_of
from mlsm_manager.joint_solver.ways.way_echoes import WayEchoes
from mlsm_manager.joint_solver.ways.way_pulls import pulled
from mlsm_manager.joint_solver.ways.ways import Ways, squares_of

_CELL = 6.0  # m: side of the squares within which ways end near each other, less than echoes may be apart


def weighed(
    ways: Ways,
    sources: WayEchoes,
    targets: WayEchoes,
    duration: float,
    kernel: SolverKernel,
    rng: np.random.RandomState,
) -> Ways:
    """Return `ways` after sources, heard in the last `duration` [s], pulled some of them and spoke for all of them.

    targets: heard before; their nodes count from the ways' first one.
    """
    if not len(sources):
        return ways
    paths, speeds, nats = ways.paths.copy(), ways.speeds.copy(), np.empty(len(ways.nats))
    for rows in groups_of(ways.paths[:, -1]):
        group = ways.selected(rows)
        nearby = nearby_of(group, sources, targets)
        group = pulled(group, sources, nearby, duration, kernel, rng)
        paths[rows, -1], speeds[rows] = group.paths[:, -1], group.speeds
        nats[rows] = nats_among(group, sources, nearby, kernel)
    return Ways(paths, speeds, ways.nats).believed(nats)


def groups_of(ends: np.ndarray) -> List[np.ndarray]:
    """Return the rows of the ends (n, 2) [m] in each square of a grid that holds any."""
    numbers = squares_of(ends, _CELL)
    order = np.argsort(numbers, kind="stable")
    return np.split(order, np.flatnonzero(np.diff(numbers[order])) + 1)
