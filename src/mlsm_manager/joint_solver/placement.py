"""Where points of scans lie in the map, in a loop that is compiled on import: never while a scan waits."""

from dataclasses import dataclass, fields
from typing import Union

import numpy as np
from numba import float64, int64, types

from node_support.numba_cache import compiled

_VALUES, _TABLE = float64[::1], float64[:, ::1]
_HEARD = types.Tuple((_VALUES, int64[::1], _VALUES, _VALUES))
TIME, NODE_X, NODE_Y, NODE_YAW, REFERENCE_X, REFERENCE_Y, GAIN_X, GAIN_Y = range(8)
"""Columns of the nodes: time, place, yaw, reference path, and gain from each to the next and beyond the last."""
KNOT_TIME, KNOT_YAW, KNOT_X, KNOT_Y = range(4)
"""Columns of the odometry's poses: time, yaw, and where the reference path is then."""
_ARMS, _NORMALS, _BY_RUN, _SHARE = 2, 4, 6, 10
PLACED_COLUMNS = 11
"""Of a placed point: place, arm, normal (x and y each), derivatives by the run (2 x 2), and share."""


@compiled()
def _knot_before(time, knots, guess):
    """Return the last of the knots (k, 4) not after `time`, but for the last of all; the search begins at a guess."""
    while guess < len(knots) - 2 and knots[guess + 1, KNOT_TIME] <= time:
        guess += 1
    while guess > 0 and knots[guess, KNOT_TIME] > time:
        guess -= 1
    return guess


@compiled()
def _at(time, knot, knots, column):
    """Return a column linearly between two knots; the nearest beyond the first and the last one."""
    before, after = knots[knot], knots[min(knot + 1, len(knots) - 1)]
    if time <= before[KNOT_TIME]:
        return before[column]
    if time >= after[KNOT_TIME]:
        return after[column]
    slope = (after[column] - before[column]) / (after[KNOT_TIME] - before[KNOT_TIME])
    return slope * (time - before[KNOT_TIME]) + before[column]


@compiled()
def _stretched(x, y, gain_x, gain_y, yaw):
    """Return a step of the reference path times a gain, turned by `yaw`."""
    cosine, sine = np.cos(yaw), np.sin(yaw)
    turn_x = gain_x * cosine - gain_y * sine
    turn_y = gain_x * sine + gain_y * cosine
    return turn_x * x - turn_y * y, turn_x * y + turn_y * x


@compiled()
def _pose(time, knot, knots, node, next_node):
    """Return x, y and heading in map, x and y of the bow, and the share of the time between two nodes."""
    share = (time - node[TIME]) / (next_node[TIME] - node[TIME])
    yaw = (1.0 - share) * node[NODE_YAW] + share * next_node[NODE_YAW]
    x = _at(time, knot, knots, KNOT_X) - node[REFERENCE_X]
    y = _at(time, knot, knots, KNOT_Y) - node[REFERENCE_Y]
    x -= share * (next_node[REFERENCE_X] - node[REFERENCE_X])
    y -= share * (next_node[REFERENCE_Y] - node[REFERENCE_Y])
    bow_x, bow_y = _stretched(x, y, node[GAIN_X], node[GAIN_Y], yaw)
    place_x = (1.0 - share) * node[NODE_X] + share * next_node[NODE_X] + bow_x
    place_y = (1.0 - share) * node[NODE_Y] + share * next_node[NODE_Y] + bow_y
    return place_x, place_y, _at(time, knot, knots, KNOT_YAW) + yaw, bow_x, bow_y, share


@compiled(_TABLE(_VALUES, _TABLE, _TABLE), error_model="numpy")
def path_rows(times, nodes, knots):
    """Return T_map_base (m, 3) at `times` (m,), also before the first of the nodes (n, 8) and after the last one.

    knots: (k, 4), k > 0, all that is around the times and the nodes next to them.
    """
    result, knot, leg = np.empty((len(times), 3)), 0, 0
    for row in range(len(times)):
        time = min(max(times[row], nodes[0, TIME]), nodes[-1, TIME])
        knot, leg = _knot_before(time, knots, knot), _knot_before(time, nodes, leg)
        x, y, heading, _, _, _ = _pose(time, knot, knots, nodes[leg], nodes[leg + 1])
        if times[row] != time:
            end, beyond = nodes[0] if times[row] < time else nodes[-1], _knot_before(times[row], knots, knot)
            change = [_at(times[row], beyond, knots, one) - _at(time, knot, knots, one) for one in (KNOT_X, KNOT_Y)]
            more_x, more_y = _stretched(change[0], change[1], end[GAIN_X], end[GAIN_Y], end[NODE_YAW])
            heading += _at(times[row], beyond, knots, KNOT_YAW) - _at(time, knot, knots, KNOT_YAW)
            x, y = x + more_x, y + more_y
        result[row, 0], result[row, 1], result[row, 2] = x, y, heading
    return result


@compiled(_TABLE(_HEARD, _TABLE, _VALUES, float64, _TABLE, _TABLE, float64), error_model="numpy")
def placed_rows(heard, normals, sonar_in_base, range_scale, nodes, knots, half_window):
    """Return points (n, PLACED_COLUMNS), heard between their nodes and the next ones.

    heard: times (n,) [s], after which nodes, how far off [m] and where [rad] by the vehicle. normals: (n, 2) by it.
    nodes: (m, 8). knots: (k, 4), k > 0, all that is around the times. half_window: s before and after, over which the
    velocity is averaged.
    """
    times, legs, ranges, bearings = heard
    result, knot = np.empty((len(times), PLACED_COLUMNS)), 0
    for point in range(len(times)):
        time, node, next_node = times[point], nodes[legs[point]], nodes[legs[point] + 1]
        knot = _knot_before(time, knots, knot)
        x, y, heading, bow_x, bow_y, share = _pose(time, knot, knots, node, next_node)
        earlier, later = time - half_window, time + half_window
        before = _pose(earlier, _knot_before(earlier, knots, knot), knots, node, next_node)
        after = _pose(later, _knot_before(later, knots, knot), knots, node, next_node)
        velocity_x, velocity_y, turn_rate = (
            (after[0] - before[0]) / (2.0 * half_window),
            (after[1] - before[1]) / (2.0 * half_window),
            (after[2] - before[2]) / (2.0 * half_window),
        )
        cosine, sine = np.cos(heading), np.sin(heading)
        sight_x = np.cos(bearings[point] + heading) * ranges[point]
        sight_y = np.sin(bearings[point] + heading) * ranges[point]
        arm_x = cosine * sonar_in_base[0] - sine * sonar_in_base[1] + (1.0 + range_scale) * sight_x
        arm_y = sine * sonar_in_base[0] + cosine * sonar_in_base[1] + (1.0 + range_scale) * sight_y
        row = result[point]
        row[0], row[1], row[_ARMS], row[_ARMS + 1] = x + arm_x, y + arm_y, arm_x + bow_x, arm_y + bow_y
        row[_NORMALS] = cosine * normals[point, 0] - sine * normals[point, 1]
        row[_NORMALS + 1] = sine * normals[point, 0] + cosine * normals[point, 1]
        row[_BY_RUN], row[_BY_RUN + 1] = sight_x, velocity_x - turn_rate * arm_y
        row[_BY_RUN + 2], row[_BY_RUN + 3] = sight_y, velocity_y + turn_rate * arm_x
        row[_SHARE] = share
    return result


@dataclass(frozen=True)
class PlacedPoints:
    """n points in the map. scans: (n,) which scan heard them. places: (n, 2) m. normals: (n, 2). slants: (n,) m.

    arms: (n, 2) m, by which the nodes' yaw turns them: from base_link to them, and the bow of the path between the
    nodes. qualities: (n,). shares: (n,) when they were heard: 0 at the scan's first node, 1 at its second. by_run: (n,
    2, 2) derivatives of the places by range scale and delay, last axis the unknown.
    """

    scans: np.ndarray
    places: np.ndarray
    arms: np.ndarray
    normals: np.ndarray
    slants: np.ndarray
    qualities: np.ndarray
    shares: np.ndarray
    by_run: np.ndarray

    def __len__(self) -> int:
        return len(self.scans)

    def selected(self, rows: Union[np.ndarray, slice]) -> "PlacedPoints":
        """Return the points in `rows`: indices, (n,) bool, or a slice, which copies nothing."""
        return PlacedPoints(*(getattr(self, field.name)[rows] for field in fields(self)))

    def joined_with(self, others: "PlacedPoints") -> "PlacedPoints":
        names = [field.name for field in fields(self)]
        return PlacedPoints(*(np.concatenate([getattr(self, name), getattr(others, name)]) for name in names))


NO_POINTS = PlacedPoints(
    scans=np.empty(0, dtype=np.int64), places=np.empty((0, 2)), arms=np.empty((0, 2)), normals=np.empty((0, 2)),
    slants=np.empty(0), qualities=np.empty(0), shares=np.empty(0), by_run=np.empty((0, 2, 2)),
)  # fmt: skip
