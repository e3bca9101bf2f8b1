"""The compiled loops that weigh comparisons, sum them for each pair of scans, and add the sums for all unknowns.

They are compiled, or read from the cache on disk, when this module is imported: never while a scan waits. Points are
rows as `comparisons` packs them.
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
    """Return the comparisons that count: rows, neighbours and importance, each (m,); see comparisons.pairs_of.

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


X, Y, ARM_X, ARM_Y, NORMAL_X, NORMAL_Y, SLANT, SHARE, BY_SCALE_X, BY_DELAY_X, BY_SCALE_Y, BY_DELAY_Y = range(12)
"""Columns of a packed point."""
POINT_COLUMNS = 12
PAIR_COLUMNS = 14
"""Of the poses of a source's two nodes, of those of the target's two, and of the run's unknowns."""


@compiled()
def _groups_of(rows, neighbours, source_scans, target_scans):
    """Return the group of each comparison (m,), and the scans of the source and of the target of each group, (g,)."""
    lowest = target_scans.min() if len(target_scans) else 0
    of_scan = np.full((target_scans.max() if len(target_scans) else 0) - lowest + 1, -1, np.int64)
    group_of = np.empty(len(rows), np.int64)
    scans, other_scans = np.empty(len(rows), np.int64), np.empty(len(rows), np.int64)
    groups, first = 0, 0
    for pair in range(len(rows)):
        scan, other = source_scans[rows[pair]], target_scans[neighbours[pair]]
        if groups > 0 and scan != scans[groups - 1]:
            first = groups
        group = of_scan[other - lowest]
        if group < first:
            group = groups
            of_scan[other - lowest] = group
            scans[group], other_scans[group] = scan, other
            groups += 1
        group_of[pair] = group
    return group_of, scans[:groups].copy(), other_scans[:groups].copy()


@compiled()
def _grouped(group_of, groups):
    """Return the order (m,) in which those of one group follow each other, and where each group begins (groups + 1,).

    group_of: (m,) from 0 to before `groups`.
    """
    starts, order = np.zeros(groups + 2, np.int64), np.empty(len(group_of), np.int64)
    for entry in range(len(group_of)):
        starts[group_of[entry] + 2] += 1
    for group in range(groups):
        starts[group + 2] += starts[group + 1]
    for entry in range(len(group_of)):
        order[starts[group_of[entry] + 1]] = entry
        starts[group_of[entry] + 1] += 1
    return order, starts[:-1]


@compiled()
def _write_slopes(source, target, slopes):
    """Write the derivatives (c,) of a comparison's residual; return that."""
    x, y = target[NORMAL_X], target[NORMAL_Y]
    residual = (source[X] - target[X]) * x + (source[Y] - target[Y]) * y
    by_yaw, by_other_yaw = source[ARM_X] * y - source[ARM_Y] * x, target[ARM_X] * y - target[ARM_Y] * x
    late, later = source[SHARE], target[SHARE]
    slopes[0], slopes[1], slopes[2] = (1.0 - late) * x, (1.0 - late) * y, (1.0 - late) * by_yaw
    slopes[3], slopes[4], slopes[5] = late * x, late * y, late * by_yaw
    slopes[6], slopes[7], slopes[8] = (later - 1.0) * x, (later - 1.0) * y, (later - 1.0) * by_other_yaw
    slopes[9], slopes[10], slopes[11] = -later * x, -later * y, -later * by_other_yaw
    by_scale_x, by_scale_y = source[BY_SCALE_X] - target[BY_SCALE_X], source[BY_SCALE_Y] - target[BY_SCALE_Y]
    by_delay_x, by_delay_y = source[BY_DELAY_X] - target[BY_DELAY_X], source[BY_DELAY_Y] - target[BY_DELAY_Y]
    slopes[12] = by_scale_x * x + by_scale_y * y - residual
    slopes[13] = by_delay_x * x + by_delay_y * y
    return residual


@compiled()
def _write_sums(slopes, residuals, weights, information, gradient):
    """Write the information (c, c) and the gradient (c,) of comparisons with slopes (n, c).

    A row is summed in variables, not in an array: so the compiler keeps it in registers, three times as fast.
    """
    for row in range(PAIR_COLUMNS):
        s0 = s1 = s2 = s3 = s4 = s5 = s6 = s7 = s8 = s9 = s10 = s11 = s12 = s13 = by_residual = 0.0
        for pair in range(len(slopes)):
            own = slopes[pair]
            weighted = weights[pair] * own[row]
            by_residual += weighted * residuals[pair]
            s0 += weighted * own[0]
            s1 += weighted * own[1]
            s2 += weighted * own[2]
            s3 += weighted * own[3]
            s4 += weighted * own[4]
            s5 += weighted * own[5]
            s6 += weighted * own[6]
            s7 += weighted * own[7]
            s8 += weighted * own[8]
            s9 += weighted * own[9]
            s10 += weighted * own[10]
            s11 += weighted * own[11]
            s12 += weighted * own[12]
            s13 += weighted * own[13]
        gradient[row] = by_residual
        information[row, 0:7] = s0, s1, s2, s3, s4, s5, s6
        information[row, 7:14] = s7, s8, s9, s10, s11, s12, s13


@compiled(
    "Tuple((i8[::1], i8[::1], f8[:,:,::1], f8[:,::1]))"
    "(i8[::1], i8[::1], f8[::1], f8[:,::1], i8[::1], f8[:,::1], i8[::1], f8, f8, f8, f8)",
    error_model="numpy",
)
def summed_comparisons(
    rows, neighbours, importance, sources, source_scans, targets, target_scans,
    least_variance, by_slant, least_weight, widening,
):  # fmt: skip
    """Return both scans (g,), information (g, c, c) and gradient (g, c) of each pair of scans; c is PAIR_COLUMNS.

    rows, neighbours, importance: (m,) as in Pairs; those of one source scan follow each other. The variance of a
    comparison is `least_variance` + `by_slant` * (sum of both squared slants).
    """
    group_of, scans, other_scans = _groups_of(rows, neighbours, source_scans, target_scans)
    order, starts = _grouped(group_of, len(scans))
    most = (starts[1:] - starts[:-1]).max() if len(scans) else 0
    slopes, residuals, weights = np.empty((most, PAIR_COLUMNS)), np.empty(most), np.empty(most)
    information, gradient = np.empty((len(scans), PAIR_COLUMNS, PAIR_COLUMNS)), np.empty((len(scans), PAIR_COLUMNS))
    for group in range(len(scans)):
        pairs = order[starts[group] : starts[group + 1]]
        for place in range(len(pairs)):
            pair = pairs[place]
            source, target = sources[rows[pair]], targets[neighbours[pair]]
            residual = _write_slopes(source, target, slopes[place])
            variance = least_variance + by_slant * (source[SLANT] * source[SLANT] + target[SLANT] * target[SLANT])
            kernel = 1.0 + residual * residual / variance / (widening * widening)
            weights[place] = least_weight / variance / (kernel * kernel) * importance[pair]
            residuals[place] = residual
        _write_sums(slopes[: len(pairs)], residuals, weights, information[group], gradient[group])
    return scans, other_scans, information, gradient


@compiled("void(f8[:,::1], i8[:,::1], f8[:,:,::1])")
def scattered_terms(matrix, columns, blocks):
    """Add blocks (m, c, c) to a matrix (n, n) in their columns (m, c)."""
    for number in range(len(columns)):
        for row in range(columns.shape[1]):
            for column in range(columns.shape[1]):
                matrix[columns[number, row], columns[number, column]] += blocks[number, row, column]
