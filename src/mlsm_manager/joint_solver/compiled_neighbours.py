"""The compiled search for the nearest points of each group of scans.

Points are sorted into square cells. Sources of one small cell have nearly the same neighbours: what may be one of
theirs is gathered once for all of them. The loops are compiled, or read from the cache on disk, when this module is
imported: never while a scan waits.
"""

from collections import namedtuple

import numpy as np

from node_support.numba_cache import compiled

_CELLS_PER_REACH = 2  # small cells leave less to compare for each source, but more to gather
_MOST_CELLS = 512  # on each side of the grid: bounds its memory, however far apart points lie


_Grid = namedtuple("_Grid", "low_x low_y rows columns side span")
"""Square cells of `side` [m], row by row from `low_x`, `low_y` on. span: how many cells a reach is at most."""


@compiled()
def _grid_around(targets, reach):
    """Return cells that cover targets (k, 2) [m], k > 0, and what lies within `reach` [m] of them."""
    low_x, low_y, high_x, high_y = targets[0, 0], targets[0, 1], targets[0, 0], targets[0, 1]
    for point in range(len(targets)):
        low_x, high_x = min(low_x, targets[point, 0]), max(high_x, targets[point, 0])
        low_y, high_y = min(low_y, targets[point, 1]), max(high_y, targets[point, 1])
    low_x, low_y, width, height = low_x - reach, low_y - reach, high_x - low_x + 2 * reach, high_y - low_y + 2 * reach
    side = max(reach / _CELLS_PER_REACH, max(width, height) / _MOST_CELLS)
    return _Grid(low_x, low_y, int(height / side) + 1, int(width / side) + 1, side, int(np.ceil(reach / side)))


@compiled()
def _sorted(places, grid):
    """Return where the points of each cell begin, and the points in this order; those in no cell are left out."""
    cell = np.empty(len(places), np.int64)
    starts = np.zeros(grid.rows * grid.columns + 2, np.int64)
    for point in range(len(places)):
        row, column = (places[point, 1] - grid.low_y) / grid.side, (places[point, 0] - grid.low_x) / grid.side
        cell[point] = -1
        if 0.0 <= row < grid.rows and 0.0 <= column < grid.columns:
            cell[point] = int(row) * grid.columns + int(column)
            starts[cell[point] + 2] += 1
    for number in range(grid.rows * grid.columns):
        starts[number + 2] += starts[number + 1]
    order = np.empty(starts[-1], np.int64)
    for point in range(len(places)):
        if cell[point] >= 0:
            order[starts[cell[point] + 1]] = point
            starts[cell[point] + 1] += 1
    return starts[:-1].copy(), order


CANDIDATES = 6
"""Nearest points of a block that may share a comparison."""
_HALF_DIAGONAL = 0.7072  # of a cell, in sides, rounded up
_SLACK = 1e-9  # m, and of a squared distance: so far may it be rounded
_NEVER = 1e300  # m^2: no point is so far away
_FIRST_CAPACITY = 1024
_NONE = np.int64(0)
"""To count from: for a plain 0 numba would compile what takes the number twice, for this 0 and for any number."""

_Targets = namedtuple("_Targets", "x y scan block row")
"""Points in the order of their cells; row: (k,) where each stood before."""
_Around = namedtuple("_Around", "place square count nearest scan other bound")
"""What lies around the middle of a cell. place, square: (k,) points and their squared distances. Of each block (b,):
its number of points, the squared distance of the nearest one, its scan, the squared distance of the nearest one of
another scan, and that up to which points may be neighbours of a source in the cell."""
_Near = namedtuple("_Near", "x y scan row square starts ends blocks")
"""Points that may be neighbours, block by block. starts, ends: (b,) where those of each block stand. blocks: (b,) those
that have any. square: (k,) squared distances from one source."""
_Candidates = namedtuple("_Candidates", "distance row")
_Found = namedtuple("_Found", "neighbours distances shares")


@compiled()
def _kept(candidates, held, distance, row):
    """Put a point among the nearest ones, of which `held` are known; return how many are known then."""
    distances, rows, place = candidates.distance, candidates.row, held
    if held == CANDIDATES:
        if distance >= distances[CANDIDATES - 1]:
            return held
        place = CANDIDATES - 1
    while place > 0 and distances[place - 1] > distance:
        distances[place], rows[place] = distances[place - 1], rows[place - 1]
        place -= 1
    distances[place], rows[place] = distance, row
    return min(held + 1, CANDIDATES)


@compiled()
def _write_shares(candidates, held, tie, found, made):
    """Share a comparison among the candidates that are hardly farther than the nearest; return how many are written."""
    distances, total = candidates.distance, 0.0
    for place in range(held):
        total += max(1.0 - (distances[place] - distances[0]) / tie, 0.0)
    for place in range(held):
        share = max(1.0 - (distances[place] - distances[0]) / tie, 0.0) / total
        if share > 0.0:
            found.neighbours[made], found.distances[made] = candidates.row[place], distances[place]
            found.shares[made] = share
            made += 1
    return made


@compiled()
def _longer(found, least):
    """Return arrays that begin with those of `found` and are at least `least` long."""
    length = max(least, 2 * len(found.shares))
    longer = _Found(np.empty(length, np.int64), np.empty(length), np.empty(length))
    longer.neighbours[: len(found.shares)] = found.neighbours
    longer.distances[: len(found.shares)] = found.distances
    longer.shares[: len(found.shares)] = found.shares
    return longer


@compiled()
def _look_around(row, column, among_sources, grid, starts, targets, around):
    """Write down what lies around a cell; return how many points that are.

    among_sources: whether the scans of the targets may be those of sources, which do not find what they heard.
    """
    x, y, count = grid.low_x + (column + 0.5) * grid.side, grid.low_y + (row + 0.5) * grid.side, 0
    around.nearest[:], around.other[:], around.scan[:], around.count[:] = _NEVER, _NEVER, -1, 0
    first, last = max(0, column - grid.span), min(grid.columns - 1, column + grid.span)
    for line in range(max(0, row - grid.span), min(grid.rows - 1, row + grid.span) + 1):
        for place in range(starts[line * grid.columns + first], starts[line * grid.columns + last + 1]):
            across, along = targets.x[place] - x, targets.y[place] - y
            square, block = across * across + along * along, targets.block[place]
            around.place[count], around.square[count] = place, square
            count += 1
            around.count[block] += 1
            if not among_sources or targets.scan[place] == around.scan[block]:
                around.nearest[block] = min(around.nearest[block], square)
            elif square < around.nearest[block]:
                around.other[block], around.nearest[block] = around.nearest[block], square
                around.scan[block] = targets.scan[place]
            elif square < around.other[block]:
                around.other[block] = square
    return count


@compiled()
def _write_bounds(scans, reach, radius, tie, around):
    """Write for each block how far from the middle of a cell neighbours of its sources, of `scans` (m,), may lie.

    The nearest target is at most `radius` farther from a source than from the middle, unless the source's own scan
    heard it; all that share the comparison are hardly farther.
    """
    for block in range(len(around.bound)):
        square = around.nearest[block]
        for scan in scans:
            if scan == around.scan[block]:
                square = around.other[block]
        around.bound[block] = min(np.sqrt(square) + 2.0 * radius + tie + _SLACK, reach + radius) ** 2


@compiled()
def _take_near(count, around, targets, near):
    """Write down, block by block, those of `count` points around a cell that are within the bounds.

    Return how many blocks have any. There is no branch for each point, which would be guessed wrongly too often.
    """
    start = 0
    for block in range(len(around.bound)):
        near.starts[block], near.ends[block] = start, start
        start += around.count[block]
    for entry in range(count):
        place = around.place[entry]
        block = targets.block[place]
        own = near.ends[block]
        near.x[own], near.y[own] = targets.x[place], targets.y[place]
        near.scan[own], near.row[own] = targets.scan[place], targets.row[place]
        near.ends[block] = own + (1 if around.square[entry] <= around.bound[block] else 0)
    blocks = 0
    for block in range(len(around.bound)):
        if near.ends[block] > near.starts[block]:
            near.blocks[blocks] = block
            blocks += 1
    return blocks


@compiled()
def _measure(x, y, scan, count, near):
    """Write the squared distances of the first `count` places from x, y; what the same scan heard is never near."""
    for place in range(count):
        across, along = near.x[place] - x, near.y[place] - y
        near.square[place] = across * across + along * along if near.scan[place] != scan else _NEVER


@compiled()
def _nearest_place(start, end, near):
    """Return where from `start` to before `end` the nearest point stands."""
    least, nearest = _NEVER, start
    for place in range(start, end):
        nearer = near.square[place] < least
        least = near.square[place] if nearer else least
        nearest = place if nearer else nearest
    return nearest


@compiled()
def _write_nearest(blocks, cut, tie, near, candidates, found, made):
    """Write the points of each block nearest to one source after the `made` ones; return how many are written then."""
    for number in range(blocks):
        start, end = near.starts[near.blocks[number]], near.ends[near.blocks[number]]
        nearest = _nearest_place(start, end, near)
        if near.square[nearest] >= cut * cut:
            continue
        distance = np.sqrt(near.square[nearest])
        limit, held = (distance + tie) ** 2 * (1.0 + _SLACK), _NONE
        for place in range(start, end):
            held += near.square[place] <= limit
        if held == 1:
            found.neighbours[made], found.distances[made], found.shares[made] = near.row[nearest], distance, 1.0
            made += 1
            continue
        held = _NONE
        for place in range(start, end):
            if near.square[place] <= limit:
                held = _kept(candidates, held, np.sqrt(near.square[place]), near.row[place])
        made = _write_shares(candidates, held, tie, found, made)
    return made


@compiled()
def _in_order(starts, ends, found):
    """Return rows of sources, rows of their neighbours, distances and shares, source by source.

    starts, ends: (n,) where in `found` those of each source stand.
    """
    count = (ends - starts).sum()
    rows, neighbours = np.empty(count, np.int64), np.empty(count, np.int64)
    distances, shares = np.empty(count), np.empty(count)
    made = 0
    for source in range(len(starts)):
        for place in range(starts[source], ends[source]):
            rows[made], neighbours[made] = source, found.neighbours[place]
            distances[made], shares[made] = found.distances[place], found.shares[place]
            made += 1
    return rows, neighbours, distances, shares


@compiled()
def _room(points, blocks):
    """Return room for what lies around a cell, and for what is near its sources."""
    around = _Around(
        np.empty(points, np.int64), np.empty(points), np.empty(blocks, np.int64), np.empty(blocks),
        np.empty(blocks, np.int64), np.empty(blocks), np.empty(blocks),
    )  # fmt: skip
    near = _Near(
        np.empty(points), np.empty(points), np.empty(points, np.int64), np.empty(points, np.int64), np.empty(points),
        np.empty(blocks, np.int64), np.empty(blocks, np.int64), np.empty(blocks, np.int64),
    )  # fmt: skip
    return around, near


@compiled(
    "Tuple((i8[::1], i8[::1], f8[::1], f8[::1]))(f8[:,::1], i8[::1], f8[:,::1], i8[::1], i8[::1], f8, f8)",
    error_model="numpy",
)
def shared_neighbours(sources, source_scans, places, scans, blocks, cut, tie):
    """Return rows of sources, rows of their neighbours, distances and shares, each (m,); see comparisons.neighbours_of.

    sources: (n, 2) m. places: (k, 2) m, scans: (k,), blocks: (k,) from 0 on: of the targets, k > 0.
    """
    reach, count = cut + tie, blocks.max() + 1
    grid = _grid_around(places, reach)
    target_starts, target_order = _sorted(places, grid)
    source_starts, source_order = _sorted(sources, grid)
    x, y = places[:, 0].copy()[target_order], places[:, 1].copy()[target_order]
    targets = _Targets(x, y, scans[target_order], blocks[target_order], target_order)
    around, near = _room(len(places), count)
    among_sources = scans.max() >= source_scans.min() and scans.min() <= source_scans.max()
    candidates = _Candidates(np.empty(CANDIDATES), np.empty(CANDIDATES, np.int64))
    found = _Found(np.empty(_FIRST_CAPACITY, np.int64), np.empty(_FIRST_CAPACITY), np.empty(_FIRST_CAPACITY))
    starts, ends = np.zeros(len(sources), np.int64), np.zeros(len(sources), np.int64)
    made = _NONE
    for cell in range(grid.rows * grid.columns):
        own = source_order[source_starts[cell] : source_starts[cell + 1]]
        if not len(own):
            continue
        row, column = cell // grid.columns, cell % grid.columns
        looked_at = _look_around(row, column, among_sources, grid, target_starts, targets, around)
        _write_bounds(source_scans[own], reach, _HALF_DIAGONAL * grid.side, tie, around)
        blocks_near = _take_near(looked_at, around, targets, near)
        for source in own:
            if made + count * CANDIDATES > len(found.shares):
                found = _longer(found, made + count * CANDIDATES)
            starts[source] = made
            _measure(sources[source, 0], sources[source, 1], source_scans[source], looked_at, near)
            made = _write_nearest(blocks_near, cut, tie, near, candidates, found, made)
            ends[source] = made
    return _in_order(starts, ends, found)
