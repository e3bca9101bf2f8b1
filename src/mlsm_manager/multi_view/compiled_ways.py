"""The compiled loop that compares echoes with those of each way: as in `way_comparisons` but for rounding.

It is compiled, or read from the cache on disk, when this module is imported: never while a scan waits. Raises
ImportError without numba.
"""

import numpy as np
from numba import njit


@njit(cache=True)
def _least_squared(x, y, lone, path, rows, nodes, arms, shares, normals, weights, farthest):
    """Return the least of `farthest` and the squared deviations of x, y from the targets in `rows` of one way."""
    least = farthest
    for row in rows:
        node, share = nodes[row], shares[row]
        across_x = x - arms[row, 0] - (1.0 - share) * path[node, 0] - share * path[node + 1, 0]
        across_y = y - arms[row, 1] - (1.0 - share) * path[node, 1] - share * path[node + 1, 1]
        if lone:
            squared = (across_x * across_x + across_y * across_y) * weights[2]
        else:
            across = across_x * normals[row, 0] + across_y * normals[row, 1]
            along = across_y * normals[row, 0] - across_x * normals[row, 1]
            squared = across * across * weights[0] + along * along * weights[1]
        least = min(least, squared)
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
    for way in range(len(paths)):
        path = paths[way]
        for source in range(len(shares)):
            share = shares[source]
            x = arms[source, 0] + (1.0 - share) * path[last, 0] + share * path[last + 1, 0]
            y = arms[source, 1] + (1.0 - share) * path[last, 1] + share * path[last + 1, 1]
            rows = candidates[starts[source] : starts[source + 1]]
            squared = _least_squared(
                x, y, lone[source], path, rows, target_nodes, target_arms, target_shares, target_normals, weights,
                farthest,
            )  # fmt: skip
            if squared < farthest:
                result[way] += nats[source] * np.exp(-0.5 * squared)
    return result
