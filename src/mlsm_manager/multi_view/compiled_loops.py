"""The compiled loops of comparisons: a search for neighbours over square cells, and sums for each pair of scans.

Each loop is compiled, or read from the cache on disk, when this module is imported: never while a scan waits. Points
are rows as `compiled_comparisons` packs them. Raises ImportError, which says what to install, without numba.
"""

import numpy as np

try:
    from numba import njit
except ImportError:
    raise ImportError("solver_kernel = NUMBA needs numba; install it with: apt install python3-numba") from None

X, Y, ARM_X, ARM_Y, NORMAL_X, NORMAL_Y, SLANT, SHARE, BY_SCALE_X, BY_DELAY_X, BY_SCALE_Y, BY_DELAY_Y = range(12)
"""Columns of a packed point."""
POINT_COLUMNS = 12
PAIR_COLUMNS = 14
"""Of the poses of a source's two nodes, of those of the target's two, and of the run's unknowns."""
CANDIDATES = 6
"""Nearest points that may share a comparison."""
_MOST_CELLS = 512  # on each side of the grid of cells: bounds its memory, however far apart points lie
_SLACK = 1.0 + 1e-9  # of a squared distance: so far may it be rounded
_FIRST_CAPACITY = 1024


@njit(cache=True)
def _kept(near, index, held, distance, target):
    """Put a target among the nearest ones of a block, of which `held` are known; return how many are known then."""
    place = held
    if held == CANDIDATES:
        if distance >= near[CANDIDATES - 1]:
            return held
        place = CANDIDATES - 1
    while place > 0 and near[place - 1] > distance:
        near[place], index[place] = near[place - 1], index[place - 1]
        place -= 1
    near[place], index[place] = distance, target
    return min(held + 1, CANDIDATES)


@njit(cache=True)
def _doubled(array):
    """Return an array that begins with `array` and is twice as long."""
    longer = np.empty(2 * len(array), array.dtype)
    longer[: len(array)] = array
    return longer


@njit(cache=True)
def _write_shares(near, index, held, tie, neighbours, distances, shares):
    """Share a comparison among the candidates that are hardly farther than the nearest; return how many are written."""
    made = 0
    total = 0.0
    for place in range(held):
        total += max(1.0 - (near[place] - near[0]) / tie, 0.0)
    for place in range(held):
        share = max(1.0 - (near[place] - near[0]) / tie, 0.0) / total
        if share > 0.0:
            neighbours[made], distances[made], shares[made] = index[place], near[place], share
            made += 1
    return made


@njit(cache=True)
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


@njit("Tuple((i8[::1], i8[::1], f8[::1], f8))(f8[:,::1], f8)", cache=True)
def sorted_into_cells(places, reach):
    """Return the order (n,) of places (n, 2), n > 0, by square cells, where each cell begins in it, low x, low y, rows
    and columns of the grid (4,), and the side of a cell [m], at least `reach`.

    Cells follow each other along x; the array of their beginnings has one more entry, the end of the last one.
    """
    low_x, low_y, high_x, high_y = places[0, 0], places[0, 1], places[0, 0], places[0, 1]
    for point in range(len(places)):
        low_x, high_x = min(low_x, places[point, 0]), max(high_x, places[point, 0])
        low_y, high_y = min(low_y, places[point, 1]), max(high_y, places[point, 1])
    side = max(reach, max(high_x - low_x, high_y - low_y) / _MOST_CELLS)
    columns, rows = int((high_x - low_x) / side) + 1, int((high_y - low_y) / side) + 1
    cell = np.empty(len(places), np.int64)
    starts = np.zeros(rows * columns + 1, np.int64)
    for point in range(len(places)):
        cell[point] = int((places[point, 1] - low_y) / side) * columns + int((places[point, 0] - low_x) / side)
        starts[cell[point] + 1] += 1
    for number in range(rows * columns):
        starts[number + 1] += starts[number]
    fill, order = starts[:-1].copy(), np.empty(len(places), np.int64)
    for point in range(len(places)):
        order[fill[cell[point]]] = point
        fill[cell[point]] += 1
    return order, starts, np.array([low_x, low_y, float(rows), float(columns)]), side


@njit(
    "Tuple((i8[::1], i8[::1], f8[::1], f8[::1]))(f8[:,::1], i8[::1], f8[:,::1], i8[::1], i8[::1], i8, f8, f8)",
    cache=True,
)
def shared_neighbours(sources, source_scans, targets, target_scans, target_blocks, blocks, cut, tie):
    """Return rows of sources, rows of their neighbours, distances and shares, each (m,); see NeighbourLists.within.

    sources, targets: (n, 2), (k, 2) m, k > 0. target_blocks: (k,) from 0 to before `blocks`. tie: see there.
    """
    reach = cut + tie
    order, starts, grid, side = sorted_into_cells(targets, reach)
    low_x, low_y, cell_rows, cell_columns = grid[0], grid[1], int(grid[2]), int(grid[3])
    target_x, target_y, scan_of, block_of = (
        targets[order, 0],
        targets[order, 1],
        target_scans[order],
        target_blocks[order],
    )
    near, index = np.empty((blocks, CANDIDATES)), np.empty((blocks, CANDIDATES), np.int64)
    farthest = np.full(blocks, reach * reach)
    held, touched = np.zeros(blocks, np.int64), np.empty(blocks, np.int64)
    rows, neighbours = np.empty(_FIRST_CAPACITY, np.int64), np.empty(_FIRST_CAPACITY, np.int64)
    distances, shares = np.empty(_FIRST_CAPACITY), np.empty(_FIRST_CAPACITY)
    made = 0
    for source in range(len(sources)):
        x, y, scan = sources[source, 0], sources[source, 1], source_scans[source]
        if not (low_x - side <= x <= low_x + (cell_columns + 1) * side):
            continue
        if not (low_y - side <= y <= low_y + (cell_rows + 1) * side):
            continue
        column, row = int(np.floor((x - low_x) / side)), int(np.floor((y - low_y) / side))
        first_column, last_column = max(column - 1, 0), min(column + 1, cell_columns - 1)
        found = 0
        for line in range(max(row - 1, 0), min(row + 1, cell_rows - 1) + 1):
            if first_column > last_column:
                break
            for place in range(
                starts[line * cell_columns + first_column], starts[line * cell_columns + last_column + 1]
            ):
                across, along = target_x[place] - x, target_y[place] - y
                square, block = across * across + along * along, block_of[place]
                if square >= farthest[block] or scan_of[place] == scan:
                    continue
                if held[block] == 0:
                    touched[found] = block
                    found += 1
                held[block] = _kept(near[block], index[block], held[block], np.sqrt(square), order[place])
                farthest[block] = min(farthest[block], _SLACK * (near[block, 0] + tie) ** 2)
        for number in range(found):
            block = touched[number]
            if near[block, 0] < cut:
                if made + CANDIDATES > len(rows):
                    rows, neighbours = _doubled(rows), _doubled(neighbours)
                    distances, shares = _doubled(distances), _doubled(shares)
                end = made + _write_shares(
                    near[block], index[block], held[block], tie, neighbours[made:], distances[made:], shares[made:]
                )
                rows[made:end] = source
                made = end
            held[block], farthest[block] = 0, reach * reach
    return rows[:made].copy(), neighbours[:made].copy(), distances[:made].copy(), shares[:made].copy()


@njit(
    "Tuple((i8[::1], i8[::1], f8[:,:,::1], f8[:,::1]))"
    "(i8[::1], i8[::1], f8[::1], f8[:,::1], i8[::1], f8[:,::1], i8[::1], f8, f8, f8, f8)",
    cache=True,
)
def summed_comparisons(
    rows, neighbours, importance, sources, source_scans, targets, target_scans,
    least_variance, by_slant, least_weight, widening,
):  # fmt: skip
    """Return both scans (g,), information (g, c, c) and gradient (g, c) of each pair of scans; c is PAIR_COLUMNS.

    rows, neighbours, importance: (m,) as in Pairs; those of one source scan follow each other. The variance of a
    comparison is `least_variance` + `by_slant` * (sum of both squared slants).
    """
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
    information = np.zeros((groups, PAIR_COLUMNS, PAIR_COLUMNS))
    gradient = np.zeros((groups, PAIR_COLUMNS))
    slopes = np.empty(PAIR_COLUMNS)
    for pair in range(len(rows)):
        source, target = sources[rows[pair]], targets[neighbours[pair]]
        residual = _write_slopes(source, target, slopes)
        variance = least_variance + by_slant * (source[SLANT] * source[SLANT] + target[SLANT] * target[SLANT])
        kernel = 1.0 + residual * residual / variance / (widening * widening)
        weight = least_weight / variance / (kernel * kernel) * importance[pair]
        block, summed = information[group_of[pair]], gradient[group_of[pair]]
        for column in range(PAIR_COLUMNS):
            weighted = weight * slopes[column]
            summed[column] += weighted * residual
            for other in range(PAIR_COLUMNS):
                block[column, other] += weighted * slopes[other]
    return scans[:groups].copy(), other_scans[:groups].copy(), information, gradient
