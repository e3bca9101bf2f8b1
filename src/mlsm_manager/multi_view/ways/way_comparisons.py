"""How much echoes speak for ways: those that lie on what the same way heard before."""

import numpy as np

from mlsm_manager.multi_view.solver_kernel import SolverKernel
from mlsm_manager.multi_view.ways.way_echoes import WayEchoes
from mlsm_manager.multi_view.ways.ways import Ways

ACROSS = 0.7  # m: deviation of an echo across the surface of another
ALONG = 1.5  # m: and along it, where it tells less
AROUND = 1.0  # m: of an echo that stands alone
FARTHEST = 12.0  # squared deviations; echoes farther apart tell nothing
FACING = 0.75  # least cosine between two normals, so that both sides of a wall stay apart
_GATE = 8.0  # m that two echoes may be apart on the mean path, besides twice the ways' spread

_AT_ONCE = 200  # ways whose echoes are placed together: as many as fit into a processor's cache


def nats_of(ways: Ways, sources: WayEchoes, targets: WayEchoes, kernel: SolverKernel) -> np.ndarray:
    """Return how much (n,) sources, heard between the ways' newest nodes, speak for n ways.

    targets: heard before; their nodes count from the ways' first one.
    """
    if not len(sources) or not len(targets):
        return np.zeros(len(ways.nats))
    candidates = candidates_of(ways, sources, targets)
    rows = np.flatnonzero(candidates.any(axis=0))
    targets, candidates = targets.selected(rows), candidates[:, rows]
    if kernel.resolved is SolverKernel.NUMPY:
        return _nats(ways, sources, targets, candidates)
    from mlsm_manager.multi_view.compiled.compiled_ways import way_nats

    of_targets, own = np.nonzero(candidates.T)
    starts = np.searchsorted(of_targets, np.arange(len(targets) + 1))
    return way_nats(
        np.ascontiguousarray(ways.paths), starts, np.ascontiguousarray(own), _columns(sources), sources.nats,
        targets.nodes, _columns(targets), FARTHEST,
    )  # fmt: skip


def candidates_of(ways: Ways, sources: WayEchoes, targets: WayEchoes) -> np.ndarray:
    """Return (s, t) bool, which of t targets s sources may lie on: of one kind, facing one way, and not too far off."""
    mean, last = ways.mean(), ways.paths.shape[1] - 2
    heard = sources.places(mean, int(sources.nodes[0]) - last)
    gate = _GATE + 2.0 * ways.paths[:, -1].std(axis=0).max()
    apart = heard[:, np.newaxis] - targets.places(mean, 0)
    near = np.hypot(apart[..., 0], apart[..., 1]) < gate
    near &= sources.lone[:, np.newaxis] == targets.lone
    return near & (sources.lone[:, np.newaxis] | (sources.normals @ targets.normals.T > FACING))


def _columns(echoes: WayEchoes) -> np.ndarray:
    """Return the points (n, 7) as `compiled_ways` takes them. One that stands alone has no normal of its own."""
    lone = echoes.lone[:, np.newaxis]
    normals = np.where(lone, [1.0, 0.0], echoes.normals)
    across = normals / np.where(lone, AROUND, ACROSS)
    along = np.column_stack([-normals[:, 1], normals[:, 0]]) / np.where(lone, AROUND, ALONG)
    return np.ascontiguousarray(np.column_stack([echoes.arms, echoes.shares, across, along]))


def _nats(ways: Ways, sources: WayEchoes, targets: WayEchoes, candidates: np.ndarray) -> np.ndarray:
    parts = np.array_split(ways.paths, max(1, len(ways.paths) // _AT_ONCE))
    return np.concatenate([_nats_of_some(paths, sources, targets, candidates) for paths in parts])


def _nats_of_some(paths: np.ndarray, sources: WayEchoes, targets: WayEchoes, candidates: np.ndarray) -> np.ndarray:
    total, last = np.zeros(len(paths)), paths.shape[1] - 2
    heard = sources.places(paths, int(sources.nodes[0]) - last).transpose(2, 1, 0)
    earlier = np.ascontiguousarray(targets.places(paths, 0).transpose(2, 1, 0))
    for source, rows in enumerate(map(np.flatnonzero, candidates)):
        if len(rows):
            x, y = (own[source] - others[rows] for own, others in zip(heard, earlier))
            squared = _squared(x, y, targets.normals[rows], bool(sources.lone[source])).min(axis=0)
            total += sources.nats[source] * np.where(squared < FARTHEST, np.exp(-0.5 * squared), 0.0)
    return total


def _squared(x: np.ndarray, y: np.ndarray, normals: np.ndarray, is_lone: bool) -> np.ndarray:
    """Return squared deviations (m, n) of offsets x, y (m, n) [m] from m points with `normals` (m, 2)."""
    if is_lone:
        return (x**2 + y**2) / AROUND**2
    normal_x, normal_y = normals[:, 0, np.newaxis], normals[:, 1, np.newaxis]
    across, along = x * normal_x + y * normal_y, y * normal_x - x * normal_y
    return (across / ACROSS) ** 2 + (along / ALONG) ** 2
