"""Beams as points in one compiled loop: the same points as `projection` makes, to the last bit. Needs numba."""

import numpy as np
from numba import float32, float64, njit, types, uint8

_TABLE = types.Array(float64, 2, "C", readonly=True)
_POSES = types.Array(float64, 3, "C", readonly=True)
_ROW = types.Array(float64, 1, "C", readonly=True)
_STRENGTHS = types.Array(uint8, 2, "C", readonly=True)


@njit(
    types.Tuple((float32[:, ::1], float64[::1]))(_TABLE, _POSES, _ROW, _STRENGTHS, _ROW, float64, float64), cache=True
)
def kept_points(headings, poses, ranges, strengths, stamps, min_range, height_limit):
    """Return the points (m, 4) of the kept bins of n beams, x y z [m] and strength, and their stamps (m,).

    headings: (n, s) of the s points side by side of each bin, rad. poses: (n, 4, 4). ranges: (b,) m. strengths: (n, b).
    stamps: (n,). Points come ordered by beam, side and range; see `kept_bins` for which are kept.
    """
    most = headings.size * len(ranges)
    highest = np.float32(height_limit)  # As numpy compares
    points, taken, kept = np.empty((most, 4), np.float32), np.empty(most), 0
    for beam in range(len(headings)):
        pose = poses[beam]
        for heading in headings[beam]:
            along, across = np.cos(heading), np.sin(heading)
            x = pose[0, 0] * along + pose[0, 1] * across
            y = pose[1, 0] * along + pose[1, 1] * across
            z = pose[2, 0] * along + pose[2, 1] * across
            for bin_number in range(len(ranges)):
                distance = ranges[bin_number]
                points[kept, 0] = x * distance + pose[0, 3]
                points[kept, 1] = y * distance + pose[1, 3]
                points[kept, 2] = z * distance + pose[2, 3]
                points[kept, 3] = strengths[beam, bin_number]
                taken[kept] = stamps[beam]
                kept += (distance >= min_range) & (points[kept, 2] <= highest)
    return points[:kept], taken[:kept]
