"""The compiled loops that weigh comparisons, sum them for each pair of scans, and add the sums for all unknowns.

They are compiled, or read from the cache on disk, when this module is imported: never while a scan waits. Points are
rows as `comparisons` packs them.
"""

from typing import NamedTuple

import numpy as np
from numba import float64, int64, types

from node_support.numba_cache import compiled


class Pairs(NamedTuple):
    """m comparisons: rows of the compared points and of their neighbours in two sets of placed points.

    importance: (m,) factors of their weights, above 0 to 1.
    """

    rows: np.ndarray
    neighbours: np.ndarray
    importance: np.ndarray


_ROWS, _VALUES, _TABLE = int64[::1], float64[::1], float64[:, ::1]
_PAIRS = types.NamedTuple((_ROWS, _ROWS, _VALUES), Pairs)
_SURFACES, _PACKED = types.Tuple((_TABLE, _VALUES)), types.Tuple((_TABLE, _ROWS))


@compiled()
def _ramp(value, zero, one):
    """Return 0 for a value at `zero` and beyond, 1 at `one` and beyond, and linearly between."""
    return min(max((value - zero) / (one - zero), 0.0), 1.0)


@compiled(
    _PAIRS(types.Tuple((_ROWS, _ROWS, _VALUES, _VALUES)), _SURFACES, _SURFACES, types.UniTuple(float64, 4)),
    error_model="numpy",
)
def weighed_pairs(found, sources, targets, limits):
    """Return the comparisons that count; see comparisons.comparisons_of. found: what neighbours_of returns.

    sources, targets: normals (n, 2) of points, and how well they are known (n,). limits: distance [m] from which on
    pairs do not count, and up to which they count fully; likewise the cosines between both normals.
    """
    rows, neighbours, distances, shares = found
    normals, qualities = sources
    other_normals, other_qualities = targets
    cut, near, least, full = limits
    own, met, importance = np.empty(len(rows), np.int64), np.empty(len(rows), np.int64), np.empty(len(rows))
    made = 0
    for pair in range(len(rows)):
        i, j = rows[pair], neighbours[pair]
        cosine = normals[i, 0] * other_normals[j, 0] + normals[i, 1] * other_normals[j, 1]
        faded = _ramp(distances[pair], cut, near)
        faded *= _ramp(cosine, least, full)
        weight = shares[pair] * faded * qualities[i] * other_qualities[j]
        if weight > 0.0:
            own[made], met[made], importance[made] = i, j, weight
            made += 1
    return Pairs(own[:made].copy(), met[:made].copy(), importance[:made].copy())


X, Y, ARM_X, ARM_Y, NORMAL_X, NORMAL_Y, SLANT, SHARE, BY_SCALE_X, BY_DELAY_X, BY_SCALE_Y, BY_DELAY_Y = range(12)
"""Columns of a packed point."""
POINT_COLUMNS = 12
_PAIR_COLUMNS = 14  # of the poses of a source's two nodes, of those of the target's two, and of the run's unknowns


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
    """Write the derivatives (c,) of a comparison's residual; return that.

    The target's normal turns with its yaw: else two scans that turn together would seem to disagree, and the fit would
    pretend to know how the whole map is turned.
    """
    x, y = target[NORMAL_X], target[NORMAL_Y]
    apart_x, apart_y = source[X] - target[X], source[Y] - target[Y]
    residual = apart_x * x + apart_y * y
    by_yaw = source[ARM_X] * y - source[ARM_Y] * x
    by_other_yaw = (target[ARM_X] + apart_x) * y - (target[ARM_Y] + apart_y) * x
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
    for row in range(_PAIR_COLUMNS):
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
    types.Tuple((_ROWS, _ROWS, float64[:, :, ::1], _TABLE))(
        types.Tuple((_ROWS, _ROWS, _VALUES)), _PACKED, _PACKED, types.UniTuple(float64, 3), float64
    ),
    error_model="numpy",
)
def summed_comparisons(pairs, sources, targets, noise, widening):
    """Return both scans (g,), information (g, c, c) and gradient (g, c) of each pair of scans; c is _PAIR_COLUMNS.

    pairs: members of Pairs; those whose sources are of one scan follow each other. sources, targets: packed points, and
    which scans heard them. noise: the variance of a comparison is its first member, and its second one times the sum of
    both squared slants; the third one is the weight of each. widening: of the robust kernel.
    """
    rows, neighbours, importance = pairs
    points, source_scans = sources
    other_points, target_scans = targets
    constant, by_slant, whole_weight = noise
    group_of, scans, other_scans = _groups_of(rows, neighbours, source_scans, target_scans)
    order, starts = _grouped(group_of, len(scans))
    most = (starts[1:] - starts[:-1]).max() if len(scans) else 0
    slopes, residuals, weights = np.empty((most, _PAIR_COLUMNS)), np.empty(most), np.empty(most)
    information, gradient = np.empty((len(scans), _PAIR_COLUMNS, _PAIR_COLUMNS)), np.empty((len(scans), _PAIR_COLUMNS))
    for group in range(len(scans)):
        own = order[starts[group] : starts[group + 1]]
        for place in range(len(own)):
            pair = own[place]
            source, target = points[rows[pair]], other_points[neighbours[pair]]
            residual = _write_slopes(source, target, slopes[place])
            slants = source[SLANT] * source[SLANT] + target[SLANT] * target[SLANT]
            variance = constant + by_slant * slants
            kernel = 1.0 + residual * residual / variance / (widening * widening)
            weights[place] = whole_weight / variance / (kernel * kernel) * importance[pair]
            residuals[place] = residual
        _write_sums(slopes[: len(own)], residuals, weights, information[group], gradient[group])
    return scans, other_scans, information, gradient


@compiled("void(f8[:,::1], i8[:,::1], f8[:,:,::1])")
def scattered_terms(matrix, columns, blocks):
    """Add blocks (m, c, c) to a matrix (n, n) in their columns (m, c)."""
    for number in range(len(columns)):
        for row in range(columns.shape[1]):
            for column in range(columns.shape[1]):
                matrix[columns[number, row], columns[number, column]] += blocks[number, row, column]
