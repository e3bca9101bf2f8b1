"""How likely the echoes of a whole run are on a path and on shifted ones, and which posts are missed there."""

from typing import NamedTuple, Union

import numpy as np
from scipy.spatial import cKDTree

from mlsm_manager.hovering.compiled_particles import ACROSS, ALONG, AROUND, FARTHEST, Echoes
from mlsm_manager.hovering.particles import FACING

_FARTHEST_ALONG = ALONG * FARTHEST**0.5  # m: echoes farther apart tell nothing of each other
_SAME = 3.0  # m: an echo so near a place was heard of what stands there, or of what stands beside it
_NEAREST = 4.0  # m from the vehicle: nearer, the beam may pass above
_WIDTH, _BREADTH = 0.05, 0.5  # rad, m: a surface hides what lies so near to the line of sight behind it


class _Pairs(NamedTuple):
    """p echoes with earlier ones. sources, targets: (p,) rows. offsets: (p, 2) m from targets, along the axis and to
    its left. normals: (p, 2) of the targets, the same way.
    """

    sources: np.ndarray
    targets: np.ndarray
    offsets: np.ndarray
    normals: np.ndarray

    def chosen(self, rows: Union[np.ndarray, slice]) -> "_Pairs":
        return _Pairs(*(array[rows] for array in self))


def log_likelihood(echoes: Echoes, path: np.ndarray) -> float:
    """Return that of `echoes` of all scans on a path (k, 2) [m] in map through all nodes.

    Each echo counts as far as it lies on one of an earlier scan, as it does for each particle of a ParticleFilter.
    """
    if not echoes.size:
        return 0.0
    places, best = echoes.places(path, 0), np.zeros(echoes.size)
    near = cKDTree(places).query_pairs(_FARTHEST_ALONG, output_type="ndarray")
    later = np.where(echoes.nodes[near[:, 0]] > echoes.nodes[near[:, 1]], 0, 1)
    rows = np.arange(len(near))
    pairs = _comparable(echoes, places, near[rows, later], near[rows, 1 - later], np.array([1.0, 0.0]))
    np.maximum.at(best, pairs.sources, _nearness(echoes, pairs, 0.0))
    return float(echoes.weights @ best)


def shift_gains(echoes: Echoes, path: np.ndarray, axis: np.ndarray, shifts: np.ndarray) -> np.ndarray:
    """Return the log likelihoods (s, m) gained by shifting `path` by each of `shifts` (m,) [m] from each of s scans on.

    axis: (2,) unit vector along which it is shifted. A shift changes the path at once, so that the scans within which
    the vehicle goes that far count a little wrong.
    """
    pairs = _pairs_within(echoes, echoes.places(path, 0), axis, float(np.abs(shifts).max()))
    pairs = pairs.chosen(np.argsort(pairs.offsets[:, 0]))
    scans = len(path) - 1
    present = _by_scan(echoes, pairs, 0.0, scans)
    after = np.maximum.accumulate(present[:, ::-1], axis=1)[:, ::-1]
    is_shifted = echoes.nodes[:, np.newaxis] >= np.arange(1, scans)
    gains = np.zeros((scans, len(shifts)))
    for number, shift in enumerate(shifts):
        before = np.maximum.accumulate(_by_scan(echoes, pairs, float(shift), scans), axis=1)
        best = np.maximum(before[:, :-1], after[:, 1:]) - after[:, :1]
        gains[1:, number] = echoes.weights @ (best * is_shifted)
    return gains


def _by_scan(echoes: Echoes, pairs: _Pairs, shift: float, scans: int) -> np.ndarray:
    """Return how near (n, scans) each echo, shifted [m] along the axis, is to the nearest one of each earlier scan."""
    first, last = np.searchsorted(pairs.offsets[:, 0], [-shift - _FARTHEST_ALONG, -shift + _FARTHEST_ALONG])
    some = pairs.chosen(slice(first, last))
    nearness, result = _nearness(echoes, some, shift), np.zeros(echoes.size * scans)
    near = np.flatnonzero(nearness)
    np.maximum.at(result, some.sources[near] * scans + echoes.nodes[some.targets[near]], nearness[near])
    return result.reshape(echoes.size, scans)


def _nearness(echoes: Echoes, pairs: _Pairs, shift: float) -> np.ndarray:
    """Return (p,) 1 for sources on their targets to 0 for those too far, after they are shifted [m] along the axis."""
    along, left = pairs.offsets[:, 0] + shift, pairs.offsets[:, 1]
    ahead, aside = pairs.normals[:, 0], pairs.normals[:, 1]
    across, beside = along * ahead + left * aside, left * ahead - along * aside
    on_surface = (across / ACROSS) ** 2 + (beside / ALONG) ** 2
    squared = np.where(echoes.post[pairs.sources], (along**2 + left**2) / AROUND**2, on_surface)
    return np.where(squared < FARTHEST, np.exp(-0.5 * squared), 0.0)


def _pairs_within(echoes: Echoes, places: np.ndarray, axis: np.ndarray, reach: float) -> _Pairs:
    """Return the pairs that meet if sources are shifted along the axis by `reach` [m] at most."""
    found, (x, y) = [np.empty((2, 0), dtype=np.int64)], axis
    for scan in np.unique(echoes.nodes):
        own, earlier = np.flatnonzero(echoes.nodes == scan), np.flatnonzero(echoes.nodes < scan)
        offset = places[own, np.newaxis] - places[earlier]
        near = np.abs(offset[..., 1] * x - offset[..., 0] * y) < _FARTHEST_ALONG
        near &= np.abs(offset[..., 0] * x + offset[..., 1] * y) < reach + _FARTHEST_ALONG
        sources, targets = np.nonzero(near)
        found.append(np.stack([own[sources], earlier[targets]]))
    return _comparable(echoes, places, *np.concatenate(found, axis=1), axis)


def _comparable(
    echoes: Echoes, places: np.ndarray, sources: np.ndarray, targets: np.ndarray, axis: np.ndarray
) -> _Pairs:
    """Return the pairs of different scans and of one kind that, on surfaces, face the same way."""
    post = echoes.post[sources]
    facing = np.einsum("na,na->n", echoes.normals[sources], echoes.normals[targets]) > FACING
    kept = (echoes.nodes[sources] > echoes.nodes[targets]) & (post == echoes.post[targets]) & (post | facing)
    sources, targets = sources[kept], targets[kept]
    to_axis = np.array([[axis[0], -axis[1]], [axis[1], axis[0]]])
    return _Pairs(sources, targets, (places[sources] - places[targets]) @ to_axis, echoes.normals[targets] @ to_axis)


class MissedPosts:
    """Posts that other turns should have heard too if a path were true.

    What stands alone and was heard from far away is heard from nearer too, unless something stands before it. Where a
    path is wrong the vehicle seems to have passed posts without hearing them.
    """

    def __init__(self, echoes: Echoes, parts: int) -> None:
        """echoes: of all scans, the nodes of which count from 0. parts: scans per turn of the head."""
        self._echoes, self._parts = echoes, parts
        self._posts = np.flatnonzero(echoes.post & (echoes.weights > 0.0))
        self._turns = echoes.nodes // parts
        ranges = np.hypot(*echoes.arms.T)
        self._ranges, self._sights = ranges, echoes.arms / np.maximum(ranges, 1e-9)[:, np.newaxis]

    def cost(self, path: np.ndarray) -> float:
        """Return by how much they lower the log likelihood of a path (k, 2) [m] in map through all nodes.

        Each costs weight x missed / (1 + missed + heard), counting the turns that should have heard it.
        """
        posts, missed, heard = self._posts, np.zeros(len(self._posts)), np.zeros(len(self._posts))
        if not len(posts):
            return 0.0
        places = self._echoes.places(path, 0)
        origins = places - self._echoes.arms
        for turn in np.unique(self._turns):
            others = self._turns[posts] != turn
            own = np.flatnonzero(self._turns == turn)
            distance, _ = cKDTree(places[own]).query(places[posts], distance_upper_bound=_SAME)
            heard += others & np.isfinite(distance)
            nodes = path[self._parts * turn : self._parts * (turn + 1) + 1]
            silent = np.flatnonzero(others & ~np.isfinite(distance) & self._in_reach(places[posts], nodes))
            missed[silent] += ~self._hidden(places[posts[silent]], origins[own], own)
        return float(self._echoes.weights[posts] @ (missed / (1.0 + missed + heard)))

    def _in_reach(self, places: np.ndarray, nodes: np.ndarray) -> np.ndarray:
        """Return which posts (n,) at `places` (n, 2) stayed nearer to `nodes` (m, 2) than when heard."""
        distance = np.hypot(*(places[:, np.newaxis] - nodes).transpose(2, 0, 1))
        return (distance.max(axis=1) < self._ranges[self._posts]) & (distance.min(axis=1) > _NEAREST)

    def _hidden(self, places: np.ndarray, origins: np.ndarray, own: np.ndarray) -> np.ndarray:
        """Return which `places` (n, 2) lie behind an echo `own` (m,) that was heard from `origins` (m, 2)."""
        offset = places[:, np.newaxis] - origins
        along = np.einsum("nma,ma->nm", offset, self._sights[own])
        beside = np.abs(offset[..., 0] * self._sights[own, 1] - offset[..., 1] * self._sights[own, 0])
        on_line = (along > 0.0) & (beside < _WIDTH * along + _BREADTH)
        return (on_line & (self._ranges[own] < along - _SAME)).any(axis=1)
