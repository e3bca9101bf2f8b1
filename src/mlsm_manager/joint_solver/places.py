"""One search over places, for all who ask where scans lie on what other scans heard (correlative search, Olson 2009).

Every place within reach is tried with few points, the best ones again with all, a little aside and with other motions
within the scan. A place is certain if the points fit there, and at no other place nearly as well.
"""

from dataclasses import dataclass
from typing import List, Tuple

import numpy as np

from mlsm_manager.joint_solver.map_support import Surfaces
from mlsm_manager.joint_solver.placement import PlacedPoints
from node_support.geometry import grid

FEWEST_POINTS = 25
"""On surfaces, that a scan must hear to tell a place: fewer fit anywhere."""
REACH = 3.0
"""Standard deviations of the place within which is searched."""
POINT_WEIGHT = 0.1
"""Log-likelihood of a point on a surface: neighbours share errors."""
MOST_POINTS = 150
"""Of one scan, that are laid on each place; neighbours on a wall say the same."""
_FEW_POINTS = 60  # of the scans, where all places are tried
_CELL = 1.0  # m: about twice the deviation of an echo, so that no place falls between two cells
_MOST_CELLS = 60  # on each side of the expected place
_MOST_PLACES = 8  # that are looked at again
_ASIDE = np.array([-0.7, 0.0, 0.7])  # m by which the scans are moved then
_OTHER = 4.0  # m from a place from which on it is another
_FIT = 0.5  # share of the points that must lie on surfaces
_LEAD = 0.1  # by which that share must exceed the one at any other place


@dataclass(frozen=True)
class Freedom:
    """Where the newest nodes may be, as far as motion and earlier scans tell it.

    of_place: (2, 2) m^2, covariance of where the newest scans end. information: (4, 4) 1/m^2 of where they begin and
    end. along: (2, 2) expected move of their beginning by that of their end. beside: (k, 2) m, moves of the beginning
    besides, that are to be tried. of_nodes: (n, width, 4) moves of the newest nodes by those of beginning and end.
    """

    of_place: np.ndarray
    information: np.ndarray
    along: np.ndarray
    beside: np.ndarray
    of_nodes: np.ndarray

    @classmethod
    def as_one(cls, of_place: np.ndarray, shares: np.ndarray, width: int) -> "Freedom":
        """Return that of scans that move as one, and the newest nodes with them by `shares` (n,) of it."""
        information, of_nodes = np.zeros((4, 4)), np.zeros((len(shares), width, 4))
        information[2:, 2:] = np.linalg.inv(of_place)
        of_nodes[:, 0, 2] = of_nodes[:, 1, 3] = shares
        return cls(of_place, information, np.eye(2), np.zeros((1, 2)), of_nodes)

    @property
    def reach(self) -> float:
        """Largest deviation of the place, m."""
        return float(np.sqrt(np.linalg.eigvalsh(self.of_place)[-1]))

    def ends(self, shifts: np.ndarray) -> np.ndarray:
        """Return the moves (k, 4) [m] of beginning and end that are expected if the end moves by (k, 2)."""
        return np.column_stack([shifts @ self.along.T, shifts])

    def cost(self, ends: np.ndarray) -> float:
        """Return the negative log-likelihood of moves (4,) of beginning and end."""
        return 0.5 * float(ends @ self.information @ ends)


@dataclass(frozen=True)
class PlaceCandidate:
    """The best place that a search found. moves: (k, width) of the newest nodes to it.

    shift: (2,) m from the expected place. fit, fit_before, elsewhere: shares of the points on surfaces there, at the
    expected place, and at the best other one. reach: m, deviation of the place.
    """

    moves: np.ndarray
    shift: np.ndarray
    fit: float
    fit_before: float
    elsewhere: float
    reach: float

    @property
    def is_certain(self) -> bool:
        """Whether the points fit there, and nowhere else."""
        return self.fit >= max(_FIT, self.elsewhere + _LEAD)

    def line(self) -> str:
        """Return it as one line for people."""
        return (
            f"{100 * self.fit:.0f} % of the echoes fit {np.hypot(*self.shift):.1f} m beside the expected place, "
            f"{100 * self.elsewhere:.0f} % at another place within {REACH * self.reach:.0f} m"
        )


def best_place(freedom: Freedom, sources: PlacedPoints, surfaces: Surfaces) -> PlaceCandidate:
    """Return where `sources` fit best to `surfaces`; nowhere, with a fit of 0, where there are none of either."""
    if not len(sources) or not len(surfaces.points):
        return PlaceCandidate(freedom.of_nodes[:0, :, 0], np.zeros(2), 0.0, 0.0, 0.0, freedom.reach)
    shifts = places_within(freedom.of_place, _MOST_CELLS)
    few = sources.selected(np.arange(0, len(sources), max(1, len(sources) // _FEW_POINTS)))
    shares = surfaces.shares(few, moved(few, freedom.ends(shifts)))
    found = [_refined(freedom, sources, surfaces, shift) for shift in _best_of(shifts, shares)]
    total = sources.qualities.sum()
    best = int(np.argmax([POINT_WEIGHT * share * total - freedom.cost(ends) for ends, share in found]))
    ends, fit = found[best]
    others = [share for other, share in found if np.hypot(*(other - ends)[2:]) > _OTHER]
    return PlaceCandidate(
        freedom.of_nodes @ ends, ends[2:], fit, float(shares[0]), max(others, default=0.0), freedom.reach
    )


def places_within(covariance: np.ndarray, most: int) -> np.ndarray:
    """Return shifts (n, 2) [m] that cover the ellipse of a covariance (2, 2); the first one is none.

    They are a cell apart; farther where there would be more than `most` on each side.
    """
    reach = REACH * np.sqrt(np.diag(covariance))
    cell = max(_CELL, float(reach.max()) / most)
    x, y = (cell * np.arange(-np.floor(one / cell), np.floor(one / cell) + 1.0) for one in reach)
    shifts = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
    distance = np.einsum("na,nb,ab->n", shifts, shifts, np.linalg.inv(covariance))
    return np.concatenate([np.zeros((1, 2)), shifts[distance <= REACH**2]])


def moved(sources: PlacedPoints, ends: np.ndarray) -> np.ndarray:
    """Return the places (k, n, 2) of points whose scan begins and ends `ends` (k, 4) beside where they are."""
    share = sources.shares[:, np.newaxis]
    return sources.places + (1.0 - share) * ends[:, np.newaxis, :2] + share * ends[:, np.newaxis, 2:]


def _best_of(shifts: np.ndarray, shares: np.ndarray) -> List[np.ndarray]:
    """Return those of `shifts` (k, 2) with the greatest shares (k,), each another place."""
    found: List[np.ndarray] = []
    for index in np.argsort(-shares, kind="stable"):
        if all(np.hypot(*(shifts[index] - other)) > _OTHER / 2.0 for other in found):
            found.append(shifts[index])
        if len(found) == _MOST_PLACES:
            break
    return found


def _refined(
    freedom: Freedom, sources: PlacedPoints, surfaces: Surfaces, shift: np.ndarray
) -> Tuple[np.ndarray, float]:
    """Return the best moves (4,) of beginning and end of the scans about a shift (2,) of both, and the share there."""
    shifts = shift + grid(_ASIDE)
    ends = np.repeat(freedom.ends(shifts), len(freedom.beside), axis=0)
    ends[:, :2] += np.tile(freedom.beside, (len(shifts), 1))
    shares = surfaces.shares(sources, moved(sources, ends))
    best = int(np.argmax(shares))
    return ends[best], float(shares[best])
