"""The compiled loop that compares echoes with those of each way: as in `way_comparisons` but for rounding.

It is compiled, or read from the cache on disk, when this module is imported: never while a scan waits. Raises
ImportError without numba.
"""

import numpy as np
from numba import njit

_NEVER = 1e300  # squared deviations: no echo lies so far away


@njit(cache=True, fastmath=True)
def _least_around(x, y, rows, places_x, places_y, weight):
    """Return the least squared deviation of x, y from the targets in `rows`, in all directions alike."""
    least = _NEVER
    for row in rows:
        offset_x, offset_y = x - places_x[row], y - places_y[row]
        least = min(least, (offset_x * offset_x + offset_y * offset_y) * weight)
    return least


@njit(cache=True, fastmath=True)
def _least_beside(x, y, rows, places_x, places_y, normals, across_weight, along_weight):
    """Return the least squared deviation of x, y from the surfaces in `rows`, across them and along them."""
    least = _NEVER
    for row in rows:
        offset_x, offset_y = x - places_x[row], y - places_y[row]
        across = offset_x * normals[row, 0] + offset_y * normals[row, 1]
        along = offset_y * normals[row, 0] - offset_x * normals[row, 1]
        least = min(least, across * across * across_weight + along * along * along_weight)
    return least


@njit(
    "f8[::1](f8[:,:,::1], i8[::1], i8[::1], f8[:,::1], f8[::1], f8[::1], b1[::1], i8[::1], f8[:,::1], f8[::1],"
    "f8[:,::1], f8[::1], f8)",
    cache=True,
    error_model="numpy",
)
def way_nats(
    paths, starts, candidates, arms, shares, nats, lone, target_nodes, target_arms, target_shares, target_normals,
    weights, farthest,
):  # fmt: skip
    """Return how much (n,) sources speak for n ways; see way_comparisons.

    paths: (n, k, 2) m. starts, candidates: rows of targets that each source may lie on. arms to lone: of the sources,
    heard between the last two nodes. target_nodes to target_normals: of the targets. weights: (3,) 1/m^2 across, along
    and around. farthest: squared deviations.
    """
    result, last = np.zeros(len(paths)), paths.shape[1] - 2
    places_x, places_y = np.empty(len(target_nodes)), np.empty(len(target_nodes))
    for way in range(len(paths)):
        path = paths[way]
        for row in range(len(target_nodes)):
            node, share = target_nodes[row], target_shares[row]
            places_x[row] = target_arms[row, 0] + (1.0 - share) * path[node, 0] + share * path[node + 1, 0]
            places_y[row] = target_arms[row, 1] + (1.0 - share) * path[node, 1] + share * path[node + 1, 1]
        for source in range(len(shares)):
            share = shares[source]
            x = arms[source, 0] + (1.0 - share) * path[last, 0] + share * path[last + 1, 0]
            y = arms[source, 1] + (1.0 - share) * path[last, 1] + share * path[last + 1, 1]
            rows = candidates[starts[source] : starts[source + 1]]
            if lone[source]:
                squared = _least_around(x, y, rows, places_x, places_y, weights[2])
            else:
                squared = _least_beside(x, y, rows, places_x, places_y, target_normals, weights[0], weights[1])
            if squared < farthest:
                result[way] += nats[source] * np.exp(-0.5 * squared)
    return result
