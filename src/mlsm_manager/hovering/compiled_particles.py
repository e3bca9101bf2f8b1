"""Compiled loops that compare echoes with earlier ones of each particle, and move particles to where they agree.

They are compiled, or read from the cache on disk, when this module is imported: never while a scan waits. Raises
ImportError without numba.
"""

from typing import NamedTuple, Sequence

import numpy as np
from numba import boolean, float64, int64, types

from node_support.numba_cache import compiled

ACROSS = 0.7  # m: standard deviation of an echo across the surface of another
ALONG = 1.5  # m: and along it, where it says less
AROUND = 1.0  # m: of a post
FARTHEST = 12.0  # squared deviations; echoes farther apart say nothing of each other
FADING = 0.25  # of squared deviations: half of what weights fade by, so that echoes pull from farther off
_ACROSS, _ALONG, _AROUND = (np.array([ACROSS, ALONG, AROUND]) ** -2.0).tolist()
_STIFFNESS = 0.7**-2.0  # 1/m^2, holds a particle's newest place before its echoes tell more
_LANES = 64  # particles that are compared at once: fewer use registers worse, more have fewer targets out of reach
_NEVER = 1e300  # squared deviations: no echo lies so far away
ARM_X, ARM_Y, SHARE, WEIGHT, ACROSS_X, ACROSS_Y, ALONG_X, ALONG_Y = range(8)
"""Columns of a point. WEIGHT: log likelihood of a source on a target. ACROSS, ALONG: two directions of a target,
divided by the deviation in each, 1/m."""


class Echoes(NamedTuple):
    """n points. nodes: (n,) those before them. arms: (n, 2) m, from the straight line between nodes to them, in map.

    shares: (n,) when they were heard, 0 at the node before, 1 at the next. normals: (n, 2) in map. weights: (n,) log
    likelihood that each adds where it lies on an earlier one. post: (n,) bool, whether it stands alone as a post does.
    """

    nodes: np.ndarray
    arms: np.ndarray
    shares: np.ndarray
    normals: np.ndarray
    weights: np.ndarray
    post: np.ndarray

    @property
    def size(self) -> int:
        return len(self.nodes)

    @classmethod
    def joined(cls, parts: "Sequence[Echoes]") -> "Echoes":
        """Return the points of all `parts`, at least one."""
        return cls(*(np.concatenate(each) for each in zip(*parts)))

    def selected(self, rows: np.ndarray) -> "Echoes":
        """Return the points in `rows` (m,)."""
        return Echoes(*(each[rows] for each in self))

    def places(self, paths: np.ndarray, first: int) -> np.ndarray:
        """Return where the points lie (..., n, 2) for paths (..., k, 2), whose first node is `first`."""
        before, share = self.nodes - first, self.shares[:, np.newaxis]
        return self.arms + (1.0 - share) * paths[..., before, :] + share * paths[..., before + 1, :]


_ROWS, _VALUES, _TABLE = int64[::1], float64[::1], float64[:, ::1]
_POINTS = types.NamedTuple((_ROWS, _TABLE, _VALUES, _TABLE, _VALUES, boolean[::1]), Echoes)


@compiled(fastmath=True)
def _write_nodes(paths, nodes, ranges):
    """Write the nodes (k, 2, lanes) of some paths (n, k, 2), the last of which fills what is left of the lanes.

    ranges: (k, 4) m, middle and half width of where the newest node is, seen from each, in x and y.
    """
    newest = paths.shape[1] - 1
    for lane in range(_LANES):
        particle = min(lane, len(paths) - 1)
        for node in range(len(nodes)):
            nodes[node, 0, lane], nodes[node, 1, lane] = paths[particle, node, 0], paths[particle, node, 1]
    for node in range(len(nodes)):
        for axis in range(2):
            least, most = _NEVER, -_NEVER
            for lane in range(_LANES):
                offset = nodes[newest, axis, lane] - nodes[node, axis, lane]
                least, most = min(least, offset), max(most, offset)
            ranges[node, axis], ranges[node, 2 + axis] = 0.5 * (least + most), 0.5 * (most - least)


@compiled()
def _write_reach(point, before, after, reach):
    """Write where the newest node is, seen from a point (4,): as `before` and `after`, the ranges of its two nodes."""
    late = point[SHARE]
    for axis in range(2):
        reach[axis] = (1.0 - late) * before[axis] + late * after[axis] - point[ARM_X + axis]
        reach[2 + axis] = (1.0 - late) * before[2 + axis] + late * after[2 + axis]


@compiled()
def _is_near(own, other, target):
    """Return whether a source may lie on a target on some particles; own, other: their reaches."""
    x, y, wide_x, wide_y = other[0] - own[0], other[1] - own[1], other[2] + own[2], other[3] + own[3]
    across = abs(x * target[ACROSS_X] + y * target[ACROSS_Y])
    across -= wide_x * abs(target[ACROSS_X]) + wide_y * abs(target[ACROSS_Y])
    along = abs(x * target[ALONG_X] + y * target[ALONG_Y])
    along -= wide_x * abs(target[ALONG_X]) + wide_y * abs(target[ALONG_Y])
    return max(across, 0.0) ** 2 + max(along, 0.0) ** 2 < FARTHEST


@compiled()
def _write_places(point, before, after, places):
    """Write where a point lies (2, lanes) on paths that are at `before` and `after` (2, lanes)."""
    late = point[SHARE]
    for axis in range(2):
        arm = point[ARM_X + axis]
        for lane in range(before.shape[1]):
            places[axis, lane] = arm + (1.0 - late) * before[axis, lane] + late * after[axis, lane]


@compiled(fastmath=True)
def _write_deviations(places, target, deviations):
    """Write `places` (2, lanes) across and along a target's surface, in deviations."""
    across_x, across_y, along_x, along_y = target[ACROSS_X], target[ACROSS_Y], target[ALONG_X], target[ALONG_Y]
    for lane in range(places.shape[1]):
        x, y = places[0, lane], places[1, lane]
        deviations[0, lane], deviations[1, lane] = x * across_x + y * across_y, x * along_x + y * along_y


@compiled(fastmath=True)
def _lower(least, places, deviations, target):
    """Lower `least` (lanes,) of a source at `places` (2, lanes) to its squared deviations from a target."""
    across_x, across_y, along_x, along_y = target[ACROSS_X], target[ACROSS_Y], target[ALONG_X], target[ALONG_Y]
    for lane in range(len(least)):
        across = places[0, lane] * across_x + places[1, lane] * across_y - deviations[0, lane]
        along = places[0, lane] * along_x + places[1, lane] * along_y - deviations[1, lane]
        least[lane] = min(least[lane], across * across + along * along)


@compiled(_VALUES(float64[:, :, ::1], _ROWS, _ROWS, _TABLE, _ROWS, _TABLE), error_model="numpy")
def log_likelihoods(paths, starts, candidates, sources, target_nodes, targets):
    """Return how much (n,) sources speak for n particles: a weight for each nearest target, fading with its distance.

    Some particles are taken at a time, so that one instruction compares several; targets that none of them can reach
    are dropped first.

    paths: (n, k, 2) m. starts, candidates: rows of the sources that may lie on each target. sources (s, 8), targets
    (t, 8): points; sources were heard between the last two nodes.
    """
    result, last = np.zeros(len(paths)), paths.shape[1] - 2
    nodes, ranges = np.empty((paths.shape[1], 2, _LANES)), np.empty((paths.shape[1], 4))
    places, least = np.empty((len(sources), 2, _LANES)), np.empty((len(sources), _LANES))
    reaches, reach = np.empty((len(sources), 4)), np.empty(4)
    target_places, deviations = np.empty((2, _LANES)), np.empty((2, _LANES))
    for first in range(0, len(paths), _LANES):
        count = min(_LANES, len(paths) - first)
        _write_nodes(paths[first : first + count], nodes, ranges)
        for source in range(len(sources)):
            _write_places(sources[source], nodes[last], nodes[last + 1], places[source])
            _write_reach(sources[source], ranges[last], ranges[last + 1], reaches[source])
        least[:] = _NEVER
        for row in range(len(targets)):
            target, node = targets[row], target_nodes[row]
            _write_reach(target, ranges[node], ranges[node + 1], reach)
            is_placed = False
            for index in range(starts[row], starts[row + 1]):
                source = candidates[index]
                if not _is_near(reaches[source], reach, target):
                    continue
                if not is_placed:
                    _write_places(target, nodes[node], nodes[node + 1], target_places)
                    _write_deviations(target_places, target, deviations)
                    is_placed = True
                _lower(least[source], places[source], deviations, target)
        for source in range(len(sources)):
            for lane in range(count):
                if least[source, lane] < FARTHEST:
                    result[first + lane] += sources[source, WEIGHT] * np.exp(-0.5 * least[source, lane])
    return result


@compiled()
def _place(arm, share, path, node):
    """Return x, y of a point that was heard after a node of a path."""
    x = arm[0] + (1.0 - share) * path[node, 0] + share * path[node + 1, 0]
    return x, arm[1] + (1.0 - share) * path[node, 1] + share * path[node + 1, 1]


@compiled()
def _nearest(x, y, rows, places, normals, is_post):
    """Return which of the targets in `rows` is nearest to x, y, and how far off in squared deviations."""
    best, least = -1, np.inf
    for row in rows:
        offset_x, offset_y = x - places[row, 0], y - places[row, 1]
        across = offset_x * normals[row, 0] + offset_y * normals[row, 1]
        along = offset_y * normals[row, 0] - offset_x * normals[row, 1]
        if is_post:
            squared = (offset_x * offset_x + offset_y * offset_y) * _AROUND
        else:
            squared = across * across * _ACROSS + along * along * _ALONG
        if squared < least:
            best, least = row, squared
    return best, least


@compiled()
def _add(sums, offset_x, offset_y, normal, is_post, weight, share):
    """Add a source's weights xx, xy, yy and forces x, y to `sums` (5,); offset: of its target from it."""
    if is_post:
        xx, xy, yy = weight, 0.0, weight
    else:
        xx, xy, yy = weight * normal[0] ** 2, weight * normal[0] * normal[1], weight * normal[1] ** 2
    sums[0] += share * share * xx
    sums[1] += share * share * xy
    sums[2] += share * share * yy
    sums[3] += share * (xx * offset_x + xy * offset_y)
    sums[4] += share * (xy * offset_x + yy * offset_y)


@compiled(_TABLE(float64[:, :, ::1], _ROWS, _ROWS, _POINTS, _POINTS), error_model="numpy")
def moves_onto_echoes(paths, starts, candidates, sources, targets):
    """Return moves (n, 2) [m] of the ends of n particles, to where the sources lie better on their nearest targets.

    paths: (n, k, 2) m. starts, candidates: rows of targets that each source may lie on. sources: heard between the
    last two nodes.
    """
    moves, last, places = np.empty((len(paths), 2)), paths.shape[1] - 2, np.empty((len(targets.nodes), 2))
    for particle in range(len(paths)):
        sums = np.array([_STIFFNESS, 0.0, _STIFFNESS, 0.0, 0.0])
        for row in range(len(places)):
            places[row] = _place(targets.arms[row], targets.shares[row], paths[particle], targets.nodes[row])
        for source in range(len(sources.nodes)):
            share, is_post = sources.shares[source], sources.post[source]
            x, y = _place(sources.arms[source], share, paths[particle], last)
            rows = candidates[starts[source] : starts[source + 1]]
            best, squared = _nearest(x, y, rows, places, targets.normals, is_post)
            if squared < FARTHEST:
                weight = sources.weights[source] * np.exp(-FADING * squared)
                weight *= _AROUND if is_post else _ACROSS
                _add(sums, places[best, 0] - x, places[best, 1] - y, targets.normals[best], is_post, weight, share)
        determinant = sums[0] * sums[2] - sums[1] ** 2
        moves[particle, 0] = (sums[2] * sums[3] - sums[1] * sums[4]) / determinant
        moves[particle, 1] = (sums[0] * sums[4] - sums[1] * sums[3]) / determinant
    return moves
