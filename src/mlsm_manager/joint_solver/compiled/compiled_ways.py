"""The compiled loop that compares echoes with those of each way: as in `way_comparisons` but for rounding.

It takes some ways at a time, so that one instruction compares several, and first drops the targets that none of them
can reach. It is compiled, or read from the cache on disk, when this module is imported: never while a scan waits.
Raises ImportError without numba.
"""

import numpy as np
from numba import njit

_LANES = 64  # ways that are compared at once: fewer use registers worse, more have fewer targets out of reach
_NEVER = 1e300  # squared deviations: no echo lies so far away
ARM_X, ARM_Y, SHARE, ACROSS_X, ACROSS_Y, ALONG_X, ALONG_Y = range(7)
"""Columns of a point. ACROSS, ALONG: two directions, divided by the deviation in each, 1/m; a source has none."""


@njit(cache=True, fastmath=True)
def _write_nodes(ways, nodes, ranges):
    """Write the nodes (k, 2, lanes) of some ways (n, k, 2), the last of which fills what is left of the lanes.

    ranges: (k, 4) m, middle and half width of where the newest node is, seen from each, in x and y.
    """
    newest = ways.shape[1] - 1
    for lane in range(_LANES):
        way = min(lane, len(ways) - 1)
        for node in range(len(nodes)):
            nodes[node, 0, lane], nodes[node, 1, lane] = ways[way, node, 0], ways[way, node, 1]
    for node in range(len(nodes)):
        for axis in range(2):
            least, most = _NEVER, -_NEVER
            for lane in range(_LANES):
                offset = nodes[newest, axis, lane] - nodes[node, axis, lane]
                least, most = min(least, offset), max(most, offset)
            ranges[node, axis], ranges[node, 2 + axis] = 0.5 * (least + most), 0.5 * (most - least)


@njit(cache=True)
def _write_reach(point, before, after, reach):
    """Write where the newest node is, seen from a point (4,): as `before` and `after`, the ranges of its two nodes."""
    late = point[SHARE]
    for axis in range(2):
        reach[axis] = (1.0 - late) * before[axis] + late * after[axis] - point[ARM_X + axis]
        reach[2 + axis] = (1.0 - late) * before[2 + axis] + late * after[2 + axis]


@njit(cache=True)
def _is_near(own, other, target, farthest):
    """Return whether a source may lie on a target on any of some ways; own, other: reaches of source and target."""
    x, y, wide_x, wide_y = other[0] - own[0], other[1] - own[1], other[2] + own[2], other[3] + own[3]
    across = abs(x * target[ACROSS_X] + y * target[ACROSS_Y])
    across -= wide_x * abs(target[ACROSS_X]) + wide_y * abs(target[ACROSS_Y])
    along = abs(x * target[ALONG_X] + y * target[ALONG_Y])
    along -= wide_x * abs(target[ALONG_X]) + wide_y * abs(target[ALONG_Y])
    return max(across, 0.0) ** 2 + max(along, 0.0) ** 2 < farthest


@njit(cache=True)
def _write_places(point, before, after, places):
    """Write where a point lies (2, lanes) on ways that are at `before` and `after` (2, lanes)."""
    late = point[SHARE]
    for axis in range(2):
        arm = point[ARM_X + axis]
        for lane in range(before.shape[1]):
            places[axis, lane] = arm + (1.0 - late) * before[axis, lane] + late * after[axis, lane]


@njit(cache=True, fastmath=True)
def _write_deviations(places, target, deviations):
    """Write `places` (2, lanes) across and along a target's surface, in deviations."""
    across_x, across_y, along_x, along_y = target[ACROSS_X], target[ACROSS_Y], target[ALONG_X], target[ALONG_Y]
    for lane in range(places.shape[1]):
        x, y = places[0, lane], places[1, lane]
        deviations[0, lane], deviations[1, lane] = x * across_x + y * across_y, x * along_x + y * along_y


@njit(cache=True, fastmath=True)
def _lower(least, places, source, deviations, across_x, across_y, along_x, along_y):
    """Lower `least` (s, lanes) of a source at `places` (s, 2, lanes) to its squared deviations from a target."""
    for lane in range(least.shape[1]):
        across = places[source, 0, lane] * across_x + places[source, 1, lane] * across_y - deviations[0, lane]
        along = places[source, 0, lane] * along_x + places[source, 1, lane] * along_y - deviations[1, lane]
        least[source, lane] = min(least[source, lane], across * across + along * along)


@njit(
    "f8[::1](f8[:,:,::1], i8[::1], i8[::1], f8[:,::1], f8[::1], i8[::1], f8[:,::1], f8)",
    cache=True,
    error_model="numpy",
)
def way_nats(paths, starts, candidates, sources, nats, target_nodes, targets, farthest):
    """Return how much (n,) sources speak for n ways; see way_comparisons.

    paths: (n, k, 2) m. starts, candidates: rows of the sources that may lie on each target. sources (s, 7), targets
    (t, 7): points; sources were heard between the last two nodes. nats: (s,) that they are worth. farthest: squared
    deviations.
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
            across_x, across_y, along_x, along_y = target[ACROSS_X], target[ACROSS_Y], target[ALONG_X], target[ALONG_Y]
            _write_reach(target, ranges[node], ranges[node + 1], reach)
            is_placed = False
            for index in range(starts[row], starts[row + 1]):
                source = candidates[index]
                if not _is_near(reaches[source], reach, target, farthest):
                    continue
                if not is_placed:
                    _write_places(target, nodes[node], nodes[node + 1], target_places)
                    _write_deviations(target_places, target, deviations)
                    is_placed = True
                _lower(least, places, source, deviations, across_x, across_y, along_x, along_y)
        for source in range(len(sources)):
            for lane in range(count):
                if least[source, lane] < farthest:
                    result[first + lane] += nats[source] * np.exp(-0.5 * least[source, lane])
    return result
