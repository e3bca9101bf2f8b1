"""How much comparisons count, in a compiled loop: as in `association` but for rounding.

It is compiled, or read from the cache on disk, when this module is imported: never while a scan waits. Raises
ImportError without numba.
"""

import numpy as np

from node_support.numba_cache import compiled


@compiled()
def _ramp(value, zero, one):
    """Return 0 for a value at `zero` and beyond, 1 at `one` and beyond, and linearly between."""
    return min(max((value - zero) / (one - zero), 0.0), 1.0)


@compiled(
    "Tuple((i8[::1], i8[::1], f8[::1]))"
    "(i8[::1], i8[::1], f8[::1], f8[::1], f8[:,::1], f8[::1], f8[:,::1], f8[::1], f8, f8, f8, f8)",
    error_model="numpy",
)
def weighed_pairs(
    rows, neighbours, distances, shares, source_normals, source_qualities, target_normals, target_qualities,
    cut, near, least_cosine, full_cosine,
):  # fmt: skip
    """Return the comparisons that count: rows, neighbours and importance, each (m,); see association.weighed.

    near: m up to which a pair counts fully. full_cosine: that from which on it does.
    """
    own, met, importance = np.empty(len(rows), np.int64), np.empty(len(rows), np.int64), np.empty(len(rows))
    made = 0
    for pair in range(len(rows)):
        i, j = rows[pair], neighbours[pair]
        cosine = source_normals[i, 0] * target_normals[j, 0] + source_normals[i, 1] * target_normals[j, 1]
        faded = _ramp(distances[pair], cut, near) * _ramp(cosine, least_cosine, full_cosine)
        weight = shares[pair] * faded * source_qualities[i] * target_qualities[j]
        if weight > 0.0:
            own[made], met[made], importance[made] = i, j, weight
            made += 1
    return own[:made].copy(), met[:made].copy(), importance[:made].copy()
