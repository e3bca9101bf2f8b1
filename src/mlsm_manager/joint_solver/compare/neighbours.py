"""Neighbours of points in blocks of scans: looked up once, and kept while the points move little (Verlet 1967)."""

from typing import Iterator, Optional, Tuple

import numpy as np
from scipy.spatial import cKDTree

from mlsm_manager.joint_solver.placing.placement import PlacedPoints

TIE = 0.05
"""m by which a neighbour may be farther than the nearest one and still count in part. Were it 0, the nearest one would
be decided by the last bit where two are equally near. More would compare each point with more neighbours."""
_CANDIDATES = 6  # kept of each point and block: more than there usually are within TIE and the points' moves
_MARGIN = 1.0  # m beyond the cut that is looked up too: so far may points move before all is looked up anew


def shares_of(distance: np.ndarray, nearest: np.ndarray) -> np.ndarray:
    """Return which shares (k, n) of the comparison of a point its k candidates at `distance` (k, n) [m] have.

    nearest: (n,) the least distance of each point. The shares add up to 1.
    """
    share = np.maximum(1.0 - (distance - nearest) / TIE, 0.0)
    return share / share.sum(axis=0)


class NeighbourLists:
    """For each point and each block of scans, the nearest points of other scans, found anew where they may be wrong.

    A list of candidates holds while no point outside of it can have come nearer: as long as the moves of all points,
    less the move that they have in common, are small against the distance of the farthest candidate.
    """

    def __init__(self, targets: PlacedPoints, block_scans: int) -> None:
        """targets: ascending by scan; every `block_scans` scans of them are searched together."""
        blocks, starts = np.unique(targets.scans // block_scans, return_index=True)
        self._ends = np.append(starts[1:], len(targets)).astype(np.int64)
        self._starts, self._blocks, self._block_scans = starts, blocks, block_scans
        self._cut = -np.inf

    def within(self, sources: PlacedPoints, targets: PlacedPoints, cut: float) -> Tuple[np.ndarray, ...]:
        """See association.Neighbours."""
        if not len(sources) or not len(targets):
            nothing = np.empty(0, dtype=np.int64)
            return nothing, nothing, np.empty(0), np.empty(0)
        moves, spread = self._moves(sources, targets) if cut <= self._cut else (np.inf, np.inf)
        if np.max(moves) + np.max(spread) > _MARGIN + self._cut - cut:
            self._begin(sources, targets, cut)
            moves, spread = np.zeros(len(sources)), np.zeros(len(self._starts))
        moved = moves[self._rows] + spread[self._block_of]
        distance = self._distances(sources, targets)
        nearest = distance.min(axis=0)
        doubtful = np.flatnonzero(self._reach - moved < np.minimum(nearest + TIE, cut))
        if len(doubtful):
            self._renew(doubtful, moved, sources, targets)
            distance[:, doubtful] = self._distances(sources, targets, doubtful)
            nearest[doubtful] = distance[:, doubtful].min(axis=0)
        return self._shared(distance, nearest, cut)

    def _shared(self, distance: np.ndarray, nearest: np.ndarray, cut: float) -> Tuple[np.ndarray, ...]:
        """Share each comparison among the candidates that are hardly farther than the nearest."""
        entries = np.flatnonzero(nearest < cut)
        distance = distance[:, entries]
        share = shares_of(distance, nearest[entries])
        rank, entry = np.nonzero(share)
        listed = entries[entry]
        return self._rows[listed], self._candidates[rank, listed], distance[rank, entry], share[rank, entry]

    def _moves(self, sources: PlacedPoints, targets: PlacedPoints) -> Tuple[np.ndarray, np.ndarray]:
        """Return how far each source (n,) and the farthest target of each block (b,) moved beside the common move."""
        moved = targets.places - self._target_places
        common = moved.mean(axis=0)
        of_targets = np.hypot(*(moved - common).T)
        return np.hypot(*(sources.places - self._source_places - common).T), np.maximum.reduceat(
            of_targets, self._starts
        )

    def _begin(self, sources: PlacedPoints, targets: PlacedPoints, cut: float) -> None:
        """Look up the neighbours of all points."""
        self._cut = cut
        self._source_places, self._target_places = sources.places, targets.places
        nothing = np.empty(0, dtype=np.int64)
        rows, block_of = [nothing], [nothing]
        candidates, reach = [np.empty((_CANDIDATES, 0), dtype=np.int64)], [np.empty(0)]
        for block in range(len(self._starts)):
            for own, index, distance in self._looked_up(block, None, sources, targets):
                found = np.isfinite(distance[:, 0])
                rows.append(own[found])
                block_of.append(np.full(found.sum(), block))
                candidates.append(index[found].T)
                reach.append(np.minimum(distance[found, -1], cut + _MARGIN))
        self._rows, self._block_of = np.concatenate(rows), np.concatenate(block_of)
        self._candidates, self._reach = np.concatenate(candidates, axis=1), np.concatenate(reach)

    def _renew(self, entries: np.ndarray, moved: np.ndarray, sources: PlacedPoints, targets: PlacedPoints) -> None:
        """Look up the neighbours of `entries` again, where points have `moved` since the beginning."""
        for block in np.unique(self._block_of[entries]):
            of_block = entries[self._block_of[entries] == block]
            of_block = of_block[np.argsort(self._rows[of_block])]
            for own, index, distance in self._looked_up(block, self._rows[of_block], sources, targets):
                places = of_block[np.searchsorted(self._rows[of_block], own)]
                self._candidates[:, places] = index.T
                self._reach[places] = np.minimum(distance[:, -1], self._cut + _MARGIN) - moved[places]

    def _looked_up(self, block: int, rows: np.ndarray, sources: PlacedPoints, targets: PlacedPoints) -> Iterator:
        """Yield groups of sources, their candidates (k, _CANDIDATES) in a block and the distances of these.

        rows: of sources, ascending; None for all that the block may reach. No scan finds its own points.
        """
        start, end, bound = self._starts[block], self._ends[block], self._cut + _MARGIN
        places, scans = targets.places[start:end], targets.scans[start:end]
        if rows is None:
            near = (sources.places > places.min(axis=0) - bound) & (sources.places < places.max(axis=0) + bound)
            rows = np.flatnonzero(near.all(axis=1))
        own = sources.scans[rows] // self._block_scans == self._blocks[block]
        groups = [(rows[~own], np.ones(len(scans), dtype=bool))]
        groups += [(rows[sources.scans[rows] == scan], scans != scan) for scan in np.unique(sources.scans[rows[own]])]
        for group, others in groups:
            if len(group) and others.any():
                tree = cKDTree(places[others])
                distance, index = tree.query(sources.places[group], k=_CANDIDATES, distance_upper_bound=bound)
                known = np.append(np.flatnonzero(others) + start, -1)
                yield group, known[index], distance

    def _distances(
        self, sources: PlacedPoints, targets: PlacedPoints, entries: Optional[np.ndarray] = None
    ) -> np.ndarray:
        """Return the distances (_CANDIDATES, e) of candidates from their sources [m]; of all lists or some."""
        rows = self._rows if entries is None else self._rows[entries]
        candidates = self._candidates if entries is None else self._candidates[:, entries]
        x = targets.places[:, 0].take(candidates) - sources.places[:, 0].take(rows)
        y = targets.places[:, 1].take(candidates) - sources.places[:, 1].take(rows)
        return np.where(candidates >= 0, np.sqrt(x * x + y * y), np.inf)
