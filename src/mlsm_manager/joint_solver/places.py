"""One search over places, for all who ask where scans lie on what other scans heard (correlative search, Olson 2009).

Every place within reach is tried with few points, the best ones again with all and a little aside. A place is certain
if the points fit there, and at no other place nearly as well.
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
class PlaceCandidate:
    """The best place that a search found.

    shift: (2,) m from the expected place. fit, fit_before, elsewhere: shares of the points on surfaces there, at the
    expected place, and at the best other one. reach: m, deviation of the place.
    """

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


def best_place(covariance: np.ndarray, sources: PlacedPoints, surfaces: Surfaces) -> PlaceCandidate:
    """Return where `sources`, moved as one, fit best to `surfaces`; nowhere, with a fit of 0, without either.

    covariance: (2, 2) m^2, of their place.
    """
    reach = widest(covariance)
    if not len(sources) or not len(surfaces.points):
        return PlaceCandidate(np.zeros(2), 0.0, 0.0, 0.0, reach)
    shifts = places_within(covariance, _MOST_CELLS)
    few = sources.selected(np.arange(0, len(sources), max(1, len(sources) // _FEW_POINTS)))
    shares = surfaces.shares(few, _moved(few, shifts))
    found = [_refined(sources, surfaces, shift) for shift in _best_of(shifts, shares)]
    total, information = sources.qualities.sum(), np.linalg.inv(covariance)
    likelihoods = [POINT_WEIGHT * share * total - 0.5 * shift @ information @ shift for shift, share in found]
    best, fit = found[int(np.argmax(likelihoods))]
    others = [share for shift, share in found if np.hypot(*(shift - best)) > _OTHER]
    return PlaceCandidate(best, fit, float(shares[0]), max(others, default=0.0), reach)


def widest(covariance: np.ndarray) -> float:
    """Return the largest deviation [m] of a place with a covariance (2, 2) [m^2]."""
    return float(np.sqrt(np.linalg.eigvalsh(covariance)[-1]))


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


def _moved(sources: PlacedPoints, shifts: np.ndarray) -> np.ndarray:
    return sources.places + shifts[:, np.newaxis]


def _best_of(shifts: np.ndarray, shares: np.ndarray) -> List[np.ndarray]:
    """Return those of `shifts` (k, 2) with the greatest shares (k,), each another place."""
    found: List[np.ndarray] = []
    for index in np.argsort(-shares, kind="stable"):
        if all(np.hypot(*(shifts[index] - other)) > _OTHER / 2.0 for other in found):
            found.append(shifts[index])
        if len(found) == _MOST_PLACES:
            break
    return found


def _refined(sources: PlacedPoints, surfaces: Surfaces, shift: np.ndarray) -> Tuple[np.ndarray, float]:
    """Return the best shift (2,) of the scans about one, and the share there."""
    shifts = shift + grid(_ASIDE)
    shares = surfaces.shares(sources, _moved(sources, shifts))
    best = int(np.argmax(shares))
    return shifts[best], float(shares[best])
