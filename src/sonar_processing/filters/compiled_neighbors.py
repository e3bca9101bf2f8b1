"""Neighbours of every point of a cloud, by a k-d tree in compiled loops. Needs numba.

The tree is a heap: the children of node i are 2 i + 1 and 2 i + 2. Nodes from `len(axes)` on are leaves. A search goes
down to the leaf of its point and then visits the other sides that may be near enough, which wait on a stack.
"""

import numpy as np
from numba import boolean, float64, int64, njit, types

_LEAF_POINTS = 16  # Between 4 and 16 the time is the same within a tenth; more make the tree smaller
_DEPTH = 64  # Levels of a tree of 2^64 leaves
_SLACK = 1e-5  # Share of the radius by which float32 distances, in which PCL decides, may be rounded
_LEAST_SLACK = 1e-6  # m
_ROUNDING = 1e-12  # Share by which a squared distance to a side may be rounded
_POINTS = types.Array(float64, 2, "C", readonly=True)


@njit(cache=True)
def _partition(values, order, low, high, place):
    """Order order[low:high + 1] so that no value before `place` is greater, and none behind it smaller, than there."""
    while low < high:
        pivot = values[order[(low + high) // 2]]
        left, right = low, high
        while left <= right:
            while values[order[left]] < pivot:
                left += 1
            while values[order[right]] > pivot:
                right -= 1
            if left <= right:
                order[left], order[right] = order[right], order[left]
                left += 1
                right -= 1
        if place <= right:
            high = right
        elif place >= left:
            low = left
        else:
            return


@njit(cache=True)
def _widest_axis(columns, order, start, end):
    """Return the axis along which the points order[start:end] spread most."""
    widest, spread = 0, -1.0
    for axis in range(len(columns)):
        low = high = columns[axis, order[start]]
        for place in range(start + 1, end):
            low, high = min(low, columns[axis, order[place]]), max(high, columns[axis, order[place]])
        if high - low > spread:
            widest, spread = axis, high - low
    return widest


@njit(cache=True)
def _tree(points):
    """Return the number of each point in the tree's order (n,); the points in that order (n, 3); axis and value of each
    inner node (m,); and where the points of each node begin, with where those of the last end (2 m + 2,), of which
    inner nodes have no use.
    """
    levels = 0
    while (len(points) >> levels) > _LEAF_POINTS:
        levels += 1
    inner = (1 << levels) - 1
    axes, values = np.zeros(inner, np.int64), np.zeros(inner)
    starts, ends = np.zeros(2 * inner + 2, np.int64), np.zeros(2 * inner + 2, np.int64)
    ends[0] = len(points)
    order, columns = np.arange(len(points)), points.T.copy()
    for node in range(inner):
        start, end = starts[node], ends[node]
        middle = (start + end) // 2
        axes[node] = _widest_axis(columns, order, start, end)
        _partition(columns[axes[node]], order, start, end - 1, middle)
        values[node] = columns[axes[node], order[middle]]
        starts[2 * node + 1], ends[2 * node + 1] = start, middle
        starts[2 * node + 2], ends[2 * node + 2] = middle, end
    starts[2 * inner + 1] = len(points)
    return order, points[order], axes, values, starts


@njit(cache=True)
def _insert(nearest, held, square):
    """Insert a square into nearest[:held], sorted; with held = len(nearest) the greatest one goes."""
    place = min(held, len(nearest) - 1)
    while place > 0 and nearest[place - 1] > square:
        nearest[place] = nearest[place - 1]
        place -= 1
    nearest[place] = square


@njit(cache=True)
def _stack():
    """Return an empty stack: node (d,), squared distance (d,) and distances along the axes (d, 3) of a waiting side."""
    return np.zeros(_DEPTH, np.int64), np.zeros(_DEPTH), np.zeros((_DEPTH, 3))


@njit(cache=True)
def _next_leaf(point, axes, values, stack, waiting, reach):
    """Take the last of the `waiting` sides and go down to the leaf that is nearest to the point.

    Return the leaf, and how many sides wait then. Sides whose squared distance is not below `reach` do not wait; where
    the side taken is one of them, the leaf is -1.
    """
    nodes, squares, offsets = stack
    top = waiting - 1
    node, square = nodes[top], squares[top]
    if square >= reach:
        return np.int64(-1), top
    along = (offsets[top, 0], offsets[top, 1], offsets[top, 2])
    while node < len(axes):
        axis = axes[node]
        distance = point[axis] - values[node]
        far = 2 * node + 1 if distance >= 0.0 else 2 * node + 2
        node = 2 * node + 2 if distance >= 0.0 else 2 * node + 1
        farther = square - along[axis] * along[axis] + distance * distance
        if farther < reach:
            nodes[top], squares[top] = far, farther
            offsets[top, 0] = distance if axis == 0 else along[0]
            offsets[top, 1] = distance if axis == 1 else along[1]
            offsets[top, 2] = distance if axis == 2 else along[2]
            top += 1
    return node, top


@njit(cache=True)
def _square(points, first, second):
    x = points[first, 0] - points[second, 0]
    y = points[first, 1] - points[second, 1]
    z = points[first, 2] - points[second, 2]
    return x * x + y * y + z * z


@njit(cache=True)
def _rounded_square(points, first, second):
    x = points[first, 0] - points[second, 0]
    y = points[first, 1] - points[second, 1]
    z = points[first, 2] - points[second, 2]
    return (x * x + y * y) + z * z


@njit(cache=True)
def _mean_root(squares):
    total = 0.0
    for square in squares:
        total += np.sqrt(square)
    return total / len(squares)


@njit(float64[::1](_POINTS, int64), cache=True)
def mean_distances(points, neighbors):
    """Return the mean distance (n,) of each point (n, 3) to its `neighbors` nearest others, fewer than n."""
    order, placed, axes, values, starts = _tree(points)
    means, nearest, stack = np.empty(len(points)), np.empty(neighbors), _stack()
    for point in range(len(points)):
        here = placed[point, 0], placed[point, 1], placed[point, 2]
        held, reach, waiting = 0, np.inf, 1
        stack[0][0], stack[1][0] = 0, 0.0
        stack[2][0] = 0.0
        while waiting:
            leaf, waiting = _next_leaf(here, axes, values, stack, waiting, reach)
            if leaf < 0:
                continue
            for other in range(starts[leaf], starts[leaf + 1]):
                square = _square(placed, point, other)
                if square < reach and other != point:
                    _insert(nearest, held, square)
                    held = min(held + 1, neighbors)
                    if held == neighbors:
                        reach = nearest[neighbors - 1] * (1.0 + _ROUNDING)
        means[order[point]] = _mean_root(nearest)
    return means


@njit(boolean[::1](_POINTS, float64, int64), cache=True)
def have_neighbors(points, radius, number):
    """Return (n,) bool: which points (n, 3) have at least `number` others within `radius`, in PCL's float32."""
    order, placed, axes, values, starts = _tree(points)
    rounded, keep, stack = placed.astype(np.float32), np.zeros(len(points), np.bool_), _stack()
    reach, limit = (radius * (1.0 + _SLACK) + _LEAST_SLACK) ** 2, radius * radius
    for point in range(len(points)):
        here = placed[point, 0], placed[point, 1], placed[point, 2]
        near, waiting = 0, 1
        stack[0][0], stack[1][0] = 0, 0.0
        stack[2][0] = 0.0
        while waiting and near <= number:
            leaf, waiting = _next_leaf(here, axes, values, stack, waiting, reach)
            if leaf < 0:
                continue
            for other in range(starts[leaf], starts[leaf + 1]):
                near += np.float64(_rounded_square(rounded, point, other)) <= limit
        keep[order[point]] = near > number
    return keep
