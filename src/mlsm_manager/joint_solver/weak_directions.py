"""Removes the false information that nearly parallel walls seem to give about motion along them.

The walls of a straight canal say nothing about motion along it, but seem to, for two reasons. Their estimated normals
err; and strong echoes, which last longer, make a wall bulge where the beam is square-on, so that the bulge travels with
the vehicle. Both pretend that the vehicle stands still, since every point is compared with its nearest neighbour.
"""

from dataclasses import dataclass, replace
from typing import List, Sequence, Tuple

import numpy as np

from mlsm_manager.joint_solver.normal_equations import BEFORE_THE_RUN
from mlsm_manager.joint_solver.parameters import SolverParameters
from mlsm_manager.joint_solver.placement import PlacedPoints
from mlsm_manager.joint_solver.surface_points import ramp

_SCANS = 10
"""Scans before and after a scan, two minutes each, whose surfaces together with its own decide which direction is weak.
The normals of one scan share an error of some degrees, which would turn information across a wall into one along it."""
_COUNTED = (8.0, 4.0)
"""Times normal_deviation^2: the information along a direction, as a share of that across it, from which on it counts
fully, and below which it counts for nothing. Errors of normals make up 1; bulges that travel made up to 2.5 in
simulated canals."""
_FACING = (0.2, 0.5)
"""Length of what is left of a normal: below the first its wall faces along the weak direction and counts for nothing;
from the second on, as for a bulge of up to 60 degrees, it counts fully."""
_NOTHING = 1e-12  # keeps scans without information, and normals along a weak direction, from dividing by zero
_ALIKE = float(np.cos(0.1))  # cosine of the angle up to which directions are alike: half of what normals err by


@dataclass(frozen=True)
class WeakDirections:
    """The direction about which the surfaces around each scan say least.

    first: number of the first scan. directions: (s, 2) unit vectors in map of that scan and those after it. lost: (s,)
    from 0 to 1, the share of the information along them that does not count.
    """

    first: int
    directions: np.ndarray
    lost: np.ndarray

    @classmethod
    def of(cls, sets: Sequence[PlacedPoints], parameters: SolverParameters) -> "WeakDirections":
        """Return those of scans with points in `sets`; a scan of the run has all of its points in one of them."""
        scans = np.concatenate([points.scans for points in sets])
        if not len(scans) or parameters.normal_deviation == 0.0:
            return cls(0, np.zeros((0, 2)), np.zeros(0))
        first = int(scans.min())
        information = np.concatenate([_information(points, parameters) for points in sets])
        reach = _SCANS * parameters.parts_per_turn
        parts = [_around(np.bincount(scans - first, part), reach) for part in information.T]
        sums = np.stack(parts, axis=1).reshape(-1, 2, 2)
        values, _ = np.linalg.eigh(sums)
        shares = values[:, 0] / np.maximum(values[:, 1], _NOTHING)
        all_counts, nothing_counts = (factor * parameters.normal_deviation**2 for factor in _COUNTED)
        lost = ramp(shares, all_counts, nothing_counts)
        directions, heard = np.zeros((len(lost), 2)), np.unique(scans - first)
        directions[heard] = _in_common((sums * lost[:, np.newaxis, np.newaxis])[heard])
        return cls(first, directions, lost)

    def without(self, points: PlacedPoints, scans: np.ndarray) -> PlacedPoints:
        """Return `points` with normals turned across the weak directions of `scans` (n,), one per point.

        Distances from their surfaces are then those across. Walls that face along a weak direction do not count.
        """
        rows = scans - self.first
        known = (rows >= 0) & (rows < len(self.lost))
        if not self.lost.any() or not known.any():
            return points
        rows = np.where(known, rows, 0)
        along = np.einsum("na,na->n", points.normals, self.directions[rows])
        parts = (known * self.lost[rows] * along)[:, np.newaxis] * self.directions[rows]
        normals = points.normals - parts
        lengths = np.hypot(*normals.T)
        normals = normals / np.maximum(lengths, _NOTHING)[:, np.newaxis]
        return replace(points, normals=normals, qualities=points.qualities * ramp(lengths, *_FACING))


def without_weak_directions(
    sets: Sequence[PlacedPoints], parameters: SolverParameters
) -> Tuple[List[PlacedPoints], WeakDirections]:
    """Return `sets` without what they say along their weak directions, and these."""
    weak = WeakDirections.of(sets, parameters)
    return [weak.without(points, points.scans) for points in sets], weak


def _in_common(sums: np.ndarray) -> np.ndarray:
    """Return the weak directions (s, 2) that follow from `sums` (s, 2, 2) of information; like ones in a row share one.

    Directions that differ by 0.1 degrees would pretend to know the position along a canal to ten metres.
    """
    own = _weakest(sums)
    result, begin, together = own.copy(), 0, np.zeros((2, 2))
    for scan in range(len(sums)):
        if scan > begin and abs(own[scan] @ _weakest(together)) < _ALIKE:
            result[begin:scan], begin, together = _weakest(together), scan, np.zeros((2, 2))
        together = together + sums[scan]
    result[begin:] = _weakest(together)
    return result


def _weakest(sums: np.ndarray) -> np.ndarray:
    """Return the eigenvectors (..., 2) of the smaller eigenvalues of symmetric matrices (..., 2, 2)."""
    angles = 0.5 * np.arctan2(2.0 * sums[..., 0, 1], sums[..., 0, 0] - sums[..., 1, 1])
    return np.stack([-np.sin(angles), np.cos(angles)], axis=-1)


def _information(points: PlacedPoints, parameters: SolverParameters) -> np.ndarray:
    """Return the information of each point on a translation (n, 4) [1/m^2]: a matrix (2, 2) in one row."""
    weight = points.qualities / parameters.variances(points.slants, points.slants) * (points.scans > BEFORE_THE_RUN)
    return np.einsum("n,na,nb->nab", weight, points.normals, points.normals).reshape(-1, 4)


def _around(values: np.ndarray, reach: int) -> np.ndarray:
    """Return the sum (s,) of the values (s,) up to `reach` places from each one, near ones counting more."""
    weights = 1.0 - np.abs(np.arange(-reach, reach + 1)) / (reach + 1.0)
    return np.convolve(values, weights)[reach : reach + len(values)]


_MOST = 2.0
"""Times normal_deviation: how far the normals of one scan may err. The stated deviation was too small in one simulated
canal of six with 1.0, in none of twelve with 2.0."""


def discounted(
    information: np.ndarray, gradient: np.ndarray, scans: np.ndarray, places: np.ndarray, normal_deviation: float
) -> Tuple[np.ndarray, np.ndarray]:
    """Return `information` (g, c, c) and `gradient` (g, c) of g pairs of scans without what errors of normals explain.

    scans: (g,) the compared scan of each pair. places: (4, 2) columns of x and y of a pair's nodes, first those of the
    compared scan. normal_deviation: rad, of the surfaces' normals.

    Along the weakest direction of a scan, information counts only as far as it exceeds (2 normal_deviation)^2 times the
    information across it. The rest is taken out as if the scan might lie anywhere along that direction beside the other
    one: then nothing is said of a turn or a scale of both together, which no comparison can tell.
    """
    if not len(scans):
        return information, gradient
    _, own = np.unique(scans, return_inverse=True)
    x_and_y = places[:2]
    by_translation = information[:, x_and_y[:, np.newaxis, :, np.newaxis], x_and_y[:, np.newaxis]].sum(axis=(1, 2))
    sums = np.stack([np.bincount(own, part) for part in by_translation.reshape(-1, 4).T], axis=1).reshape(-1, 2, 2)
    values, vectors = np.linalg.eigh(sums)
    errors = (_MOST * normal_deviation) ** 2 * values[:, 1]
    lost = np.minimum(1.0, errors / np.maximum(values[:, 0], _NOTHING))[own]
    moves = np.zeros_like(gradient)
    moves[:, x_and_y] = vectors[own, np.newaxis, :, 0]
    by_move = np.einsum("gab,gb->ga", information, moves)
    share = lost / np.maximum(np.einsum("ga,ga->g", by_move, moves), _NOTHING)
    gradient = gradient - (share * np.einsum("ga,ga->g", gradient, moves))[:, np.newaxis] * by_move
    return information - (share[:, np.newaxis] * by_move)[:, :, np.newaxis] * by_move[:, np.newaxis], gradient
