"""The compiled loop that moves ways to where their echoes lie on earlier ones: as in `way_pulls` but for rounding.

It is compiled, or read from the cache on disk, when this module is imported: never while a scan waits. Raises
ImportError without numba.
"""

import numpy as np
from numba import njit


@njit(cache=True)
def _place(arm, share, path, node):
    """Return x, y of a point that was heard after a node of a path."""
    x = arm[0] + (1.0 - share) * path[node, 0] + share * path[node + 1, 0]
    return x, arm[1] + (1.0 - share) * path[node, 1] + share * path[node + 1, 1]


@njit(cache=True)
def _nearest(x, y, rows, places, normals, is_lone, weights):
    """Return which of the targets in `rows` is nearest to x, y, and how far off in squared deviations."""
    best, least = -1, np.inf
    for row in rows:
        offset_x, offset_y = x - places[row, 0], y - places[row, 1]
        across = offset_x * normals[row, 0] + offset_y * normals[row, 1]
        along = offset_y * normals[row, 0] - offset_x * normals[row, 1]
        if is_lone:
            squared = (offset_x * offset_x + offset_y * offset_y) * weights[2]
        else:
            squared = across * across * weights[0] + along * along * weights[1]
        if squared < least:
            best, least = row, squared
    return best, least


@njit(cache=True)
def _add(sums, x, y, place, normal, is_lone, weight, share):
    """Add a source's weights xx, xy, yy and forces x, y to `sums` (5,)."""
    offset_x, offset_y = place[0] - x, place[1] - y
    if is_lone:
        xx, xy, yy = weight, 0.0, weight
    else:
        xx, xy, yy = weight * normal[0] ** 2, weight * normal[0] * normal[1], weight * normal[1] ** 2
    sums[0] += share * share * xx
    sums[1] += share * share * xy
    sums[2] += share * share * yy
    sums[3] += share * (xx * offset_x + xy * offset_y)
    sums[4] += share * (xy * offset_x + yy * offset_y)


@njit(
    "f8[:,::1](f8[:,:,::1], i8[::1], i8[::1], f8[:,::1], f8[::1], f8[::1], b1[::1], i8[::1], f8[:,::1], f8[::1],"
    "f8[:,::1], f8[::1], f8, f8, f8)",
    cache=True,
    error_model="numpy",
)
def way_pulls(
    paths, starts, candidates, arms, shares, nats, lone, target_nodes, target_arms, target_shares, target_normals,
    weights, farthest, fading, stiffness,
):  # fmt: skip
    """Return moves (n, 2) [m] of the ends of n ways; see way_pulls.

    paths: (n, k, 2) m. starts, candidates: rows of targets that each source may lie on. arms to lone: of the sources,
    heard between the last two nodes. target_nodes to target_normals: of the targets. weights: (3,) 1/m^2 across, along
    and around. farthest: squared deviations. fading: of squared deviations. stiffness: 1/m^2 that holds each end.
    """
    moves, last, places = np.empty((len(paths), 2)), paths.shape[1] - 2, np.empty((len(target_nodes), 2))
    for way in range(len(paths)):
        sums = np.array([stiffness, 0.0, stiffness, 0.0, 0.0])
        for row in range(len(target_nodes)):
            places[row] = _place(target_arms[row], target_shares[row], paths[way], target_nodes[row])
        for source in range(len(shares)):
            x, y = _place(arms[source], shares[source], paths[way], last)
            rows = candidates[starts[source] : starts[source + 1]]
            best, squared = _nearest(x, y, rows, places, target_normals, lone[source], weights)
            if squared < farthest:
                weight = nats[source] * np.exp(-fading * squared) * (weights[2] if lone[source] else weights[0])
                _add(sums, x, y, places[best], target_normals[best], lone[source], weight, shares[source])
        determinant = sums[0] * sums[2] - sums[1] ** 2
        moves[way, 0] = (sums[2] * sums[3] - sums[1] * sums[4]) / determinant
        moves[way, 1] = (sums[0] * sums[4] - sums[1] * sums[3]) / determinant
    return moves
