"""Moves ways to where their newest echoes lie on earlier ones: ways drawn blindly hardly ever meet all of them."""

from typing import Tuple

import numpy as np

from mlsm_manager.joint_solver.solver_kernel import SolverKernel
from mlsm_manager.joint_solver.ways.way_comparisons import ACROSS, ALONG, AROUND, FARTHEST, Nearby, squared_deviations
from mlsm_manager.joint_solver.ways.way_echoes import WayEchoes
from mlsm_manager.joint_solver.ways.ways import Ways

_PULLED = 0.5  # share of the ways that are moved; the others stay where the motion leads them
_FREEDOM = 0.7  # m: deviation of a way's newest place before its echoes tell more
FADING = 0.25  # of squared deviations: half of what belief fades by, so that echoes pull from farther off


def pulled(
    ways: Ways, sources: WayEchoes, nearby: Nearby, duration: float, kernel: SolverKernel, rng: np.random.RandomState
) -> Ways:
    """Return `ways`, some of which end where sources, heard in the last `duration` [s], lie better on what is nearby.

    Each of these makes one step of Gauss and Newton from where it ends.
    """
    some = np.flatnonzero(rng.rand(len(ways.nats)) < _PULLED)
    moves = pulls_of(ways.selected(some), sources, nearby, kernel)
    paths, speeds = ways.paths.copy(), ways.speeds.copy()
    paths[some, -1] += moves
    speeds[some] += moves / duration
    return Ways(paths, speeds, ways.nats)


def pulls_of(ways: Ways, sources: WayEchoes, nearby: Nearby, kernel: SolverKernel) -> np.ndarray:
    """Return moves (n, 2) [m] of the ends of n ways, by which the sources come to lie better on what is nearby."""
    if kernel.resolved is SolverKernel.NUMPY:
        return _pulls(ways.paths, sources, nearby)
    from mlsm_manager.joint_solver.compiled.compiled_pulls import way_pulls

    targets, starts = nearby.targets, np.searchsorted(nearby.sources, np.arange(len(sources) + 1))
    return way_pulls(
        np.ascontiguousarray(ways.paths), starts, nearby.rows, sources.arms, sources.shares, sources.nats,
        sources.lone, targets.nodes, targets.arms, targets.shares, targets.normals,
        np.array([ACROSS, ALONG, AROUND]) ** -2.0, FARTHEST, FADING, _FREEDOM**-2.0,
    )  # fmt: skip


def _pulls(paths: np.ndarray, sources: WayEchoes, nearby: Nearby) -> np.ndarray:
    last = paths.shape[1] - 2
    heard = sources.places(paths, int(sources.nodes[0]) - last)
    earlier = nearby.targets.places(paths, 0)
    matrices, pull = np.tile(_FREEDOM**-2.0 * np.eye(2), (len(paths), 1, 1)), np.zeros((len(paths), 2))
    for source in range(len(sources)):
        rows = nearby.rows[nearby.sources == source]
        if len(rows):
            offsets = earlier[:, rows] - heard[:, source, np.newaxis]
            weights, forces = _forces(offsets, nearby.targets.normals[rows], bool(sources.lone[source]))
            share, worth = sources.shares[source], sources.nats[source]
            matrices += worth * share**2 * weights
            pull += worth * share * forces
    return np.linalg.solve(matrices, pull[..., np.newaxis])[..., 0]


def _forces(offsets: np.ndarray, normals: np.ndarray, is_lone: bool) -> Tuple[np.ndarray, np.ndarray]:
    """Return the weight (n, 2, 2) [1/m^2] and the force (n, 2) [1/m] of the nearest of m points on n ways.

    offsets: (n, m, 2) m to them. Surfaces pull across themselves only.
    """
    squared = squared_deviations(*offsets.transpose(2, 1, 0), normals, is_lone)
    best, every = squared.argmin(axis=0), np.arange(len(offsets))
    squared, offset, normal = squared[best, every], offsets[every, best], normals[best]
    fade = np.where(squared < FARTHEST, np.exp(-FADING * squared), 0.0)[:, np.newaxis, np.newaxis]
    if is_lone:
        weight = fade * np.eye(2) / AROUND**2
    else:
        weight = fade * normal[:, :, np.newaxis] * normal[:, np.newaxis] / ACROSS**2
    return weight, np.einsum("nab,nb->na", weight, offset)
