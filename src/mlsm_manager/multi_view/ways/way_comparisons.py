"""How much echoes speak for ways: those that lie on what the same way heard before."""

from typing import NamedTuple

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


class Candidates(NamedTuple):
    """starts: (n + 1,) where those of each source stand in rows. rows: (m,) of targets."""

    starts: np.ndarray
    rows: np.ndarray


def nats_of(ways: Ways, sources: WayEchoes, targets: WayEchoes, kernel: SolverKernel) -> np.ndarray:
    """Return how much (n,) sources, heard between the ways' newest nodes, speak for n ways.

    targets: heard before; their nodes count from the ways' first one.
    """
    if not len(sources) or not len(targets):
        return np.zeros(len(ways.nats))
    candidates = candidates_of(ways, sources, targets)
    rows, place_of = np.unique(candidates.rows, return_inverse=True)
    targets, candidates = targets.selected(rows), Candidates(candidates.starts, place_of)
    if kernel.resolved is SolverKernel.NUMPY:
        return _nats(ways, sources, targets, candidates)
    from mlsm_manager.multi_view.compiled.compiled_ways import way_nats

    return way_nats(
        np.ascontiguousarray(ways.paths), *candidates, sources.arms, sources.shares, sources.nats, sources.lone,
        targets.nodes, targets.arms, targets.shares, targets.normals,
        np.array([ACROSS, ALONG, AROUND]) ** -2.0, FARTHEST,
    )  # fmt: skip


def candidates_of(ways: Ways, sources: WayEchoes, targets: WayEchoes) -> Candidates:
    """Return which targets each source may lie on: of the same kind, facing the same way, and not too far off."""
    mean, last = ways.mean(), ways.paths.shape[1] - 2
    heard = sources.places(mean, int(sources.nodes[0]) - last)
    gate = _GATE + 2.0 * ways.paths[:, -1].std(axis=0).max()
    apart = heard[:, np.newaxis] - targets.places(mean, 0)
    near = np.hypot(apart[..., 0], apart[..., 1]) < gate
    near &= sources.lone[:, np.newaxis] == targets.lone
    near &= sources.lone[:, np.newaxis] | (sources.normals @ targets.normals.T > FACING)
    rows, columns = np.nonzero(near)
    return Candidates(np.searchsorted(rows, np.arange(len(sources) + 1)), columns)


def _nats(ways: Ways, sources: WayEchoes, targets: WayEchoes, candidates: Candidates) -> np.ndarray:
    parts = np.array_split(ways.paths, max(1, len(ways.paths) // _AT_ONCE))
    return np.concatenate([_nats_of_some(paths, sources, targets, candidates) for paths in parts])


def _nats_of_some(paths: np.ndarray, sources: WayEchoes, targets: WayEchoes, candidates: Candidates) -> np.ndarray:
    total, last = np.zeros(len(paths)), paths.shape[1] - 2
    heard = sources.places(paths, int(sources.nodes[0]) - last).transpose(2, 1, 0)
    earlier = np.ascontiguousarray(targets.places(paths, 0).transpose(2, 1, 0))
    for source in range(len(sources)):
        rows = candidates.rows[candidates.starts[source] : candidates.starts[source + 1]]
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
