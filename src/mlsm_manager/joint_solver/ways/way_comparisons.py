"""How much echoes speak for ways: those that lie on what the same way heard before."""

from typing import NamedTuple

import numpy as np

from mlsm_manager.joint_solver.solver_kernel import SolverKernel
from mlsm_manager.joint_solver.ways.way_echoes import WayEchoes
from mlsm_manager.joint_solver.ways.ways import Ways

ACROSS = 0.7  # m: deviation of an echo across the surface of another
ALONG = 1.5  # m: and along it, where it tells less
AROUND = 1.0  # m: of an echo that stands alone
FARTHEST = 12.0  # squared deviations; echoes farther apart tell nothing
FACING = 0.75  # least cosine between two normals, so that both sides of a wall stay apart
_GATE = 8.0  # m that two echoes may be apart on the mean path, besides twice the ways' spread

_AT_ONCE = 200  # ways whose echoes are placed together: as many as fit into a processor's cache


class Nearby(NamedTuple):
    """targets: that any source may lie on. sources, rows: (m,) pairs of a source and the row of such a target.

    Pairs stand in the order of their sources.
    """

    targets: WayEchoes
    sources: np.ndarray
    rows: np.ndarray


def nats_of(ways: Ways, sources: WayEchoes, targets: WayEchoes, kernel: SolverKernel) -> np.ndarray:
    """Return how much (n,) sources, heard between the ways' newest nodes, speak for n ways.

    targets: heard before; their nodes count from the ways' first one.
    """
    if not len(sources) or not len(targets):
        return np.zeros(len(ways.nats))
    return nats_among(ways, sources, nearby_of(ways, sources, targets), kernel)


def nearby_of(ways: Ways, sources: WayEchoes, targets: WayEchoes) -> Nearby:
    """Return which targets each source may lie on: of the same kind, facing the same way, and not too far off."""
    mean, last = ways.mean(), ways.paths.shape[1] - 2
    heard, earlier = sources.places(mean, int(sources.nodes[0]) - last), targets.places(mean, 0)
    gate = _GATE + 2.0 * ways.paths[:, -1].std(axis=0).max()
    reached = np.flatnonzero(((earlier > heard.min(axis=0) - gate) & (earlier < heard.max(axis=0) + gate)).all(axis=1))
    targets, apart = targets.selected(reached), np.abs(heard[:, np.newaxis] - earlier[reached])
    own, others = np.nonzero((apart[..., 0] < gate) & (apart[..., 1] < gate))
    facing = np.einsum("na,na->n", sources.normals[own], targets.normals[others]) > FACING
    near = np.hypot(apart[own, others, 0], apart[own, others, 1]) < gate
    near &= (sources.lone[own] == targets.lone[others]) & (sources.lone[own] | facing)
    some, rows = np.unique(others[near], return_inverse=True)
    return Nearby(targets.selected(some), own[near], rows)


def nats_among(ways: Ways, sources: WayEchoes, nearby: Nearby, kernel: SolverKernel) -> np.ndarray:
    """Return how much (n,) sources speak for n ways, each by what it may lie on."""
    if kernel.resolved is SolverKernel.NUMPY:
        return _nats(ways, sources, nearby)
    from mlsm_manager.joint_solver.compiled.compiled_ways import way_nats

    order = np.argsort(nearby.rows, kind="stable")
    starts = np.searchsorted(nearby.rows[order], np.arange(len(nearby.targets) + 1))
    return way_nats(
        np.ascontiguousarray(ways.paths), starts, nearby.sources[order], _columns(sources), sources.nats,
        nearby.targets.nodes, _columns(nearby.targets), FARTHEST,
    )  # fmt: skip


def _columns(echoes: WayEchoes) -> np.ndarray:
    """Return the points (n, 7) as `compiled_ways` takes them. One that stands alone has no normal of its own."""
    lone = echoes.lone[:, np.newaxis]
    normals = np.where(lone, [1.0, 0.0], echoes.normals)
    across = normals / np.where(lone, AROUND, ACROSS)
    along = np.column_stack([-normals[:, 1], normals[:, 0]]) / np.where(lone, AROUND, ALONG)
    return np.ascontiguousarray(np.column_stack([echoes.arms, echoes.shares, across, along]))


def _nats(ways: Ways, sources: WayEchoes, nearby: Nearby) -> np.ndarray:
    parts = np.array_split(ways.paths, max(1, len(ways.paths) // _AT_ONCE))
    return np.concatenate([_nats_of_some(paths, sources, nearby) for paths in parts])


def _nats_of_some(paths: np.ndarray, sources: WayEchoes, nearby: Nearby) -> np.ndarray:
    total, last = np.zeros(len(paths)), paths.shape[1] - 2
    heard = sources.places(paths, int(sources.nodes[0]) - last).transpose(2, 1, 0)
    earlier = np.ascontiguousarray(nearby.targets.places(paths, 0).transpose(2, 1, 0))
    for source in range(len(sources)):
        rows = nearby.rows[nearby.sources == source]
        if len(rows):
            x, y = (own[source] - others[rows] for own, others in zip(heard, earlier))
            squared = squared_deviations(x, y, nearby.targets.normals[rows], bool(sources.lone[source])).min(axis=0)
            total += sources.nats[source] * np.where(squared < FARTHEST, np.exp(-0.5 * squared), 0.0)
    return total


def squared_deviations(x: np.ndarray, y: np.ndarray, normals: np.ndarray, is_lone: bool) -> np.ndarray:
    """Return squared deviations (m, n) of offsets x, y (m, n) [m] from m points with `normals` (m, 2)."""
    if is_lone:
        return (x**2 + y**2) / AROUND**2
    normal_x, normal_y = normals[:, 0, np.newaxis], normals[:, 1, np.newaxis]
    across, along = x * normal_x + y * normal_y, y * normal_x - x * normal_y
    return (across / ACROSS) ** 2 + (along / ALONG) ** 2
