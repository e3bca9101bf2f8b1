"""Many ways that a vehicle may have gone, drawn at random and weighed by what it heard (a particle filter).

Gordon, Salmond and Smith 1993; each way is a map of its own, as in FastSLAM (Montemerlo et al. 2002).
"""

from typing import NamedTuple, Tuple

import numpy as np

Draw = Tuple[np.ndarray, np.ndarray]
"""Places (n, 2) [m] at the next node and speeds (n, 2) [m/s] there."""
HELD_SPEED = 0.02  # m/s: of a vehicle that holds its place
_ALIKE = 1.0  # m by which the ends of ways may differ that count as one
_CENTRES = 100  # ways around whose ends the others are counted: enough that one is near the middle of each group
_PLACE = 2.0  # m: side of the squares that count as one place
_ROOT = 0.5  # power of its belief by which a place is drawn: one believed a hundredth as much has a tenth of the ways
_NOTHING = 1e-300  # least belief of a place, so that none is divided by zero
_UNEVEN = 0.5  # share of the ways that must still count, or else they are drawn anew


class Ways(NamedTuple):
    """paths: (n, k, 2) m, places in map at the newest k nodes. speeds: (n, 2) m/s in map. nats: (n,) of belief."""

    paths: np.ndarray
    speeds: np.ndarray
    nats: np.ndarray

    @property
    def shares(self) -> np.ndarray:
        """(n,) of all that is believed."""
        shares = np.exp(self.nats - self.nats.max())
        return shares / shares.sum()

    def mean(self) -> np.ndarray:
        """Return the mean path (k, 2)."""
        return np.einsum("n,nka->ka", self.shares, self.paths)

    def most_believed(self) -> np.ndarray:
        """Return the mean path (k, 2) of the ways that end about where most is believed."""
        ends, shares = self.paths[:, -1], self.shares
        some = np.argsort(-shares, kind="stable")[:: max(1, len(ends) // _CENTRES)]
        alike = ((ends[some, np.newaxis] - ends) ** 2).sum(axis=2) < _ALIKE**2
        best = alike[np.argmax(alike @ shares)]
        return np.einsum("n,nka->ka", shares[best], self.paths[best]) / shares[best].sum()

    def spread(self) -> np.ndarray:
        """Return the covariance (2, 2) [m^2] of the ends."""
        ends, shares = self.paths[:, -1], self.shares
        offset = ends - shares @ ends
        return (offset * shares[:, np.newaxis]).T @ offset

    def selected(self, rows: np.ndarray) -> "Ways":
        """Return the ways in `rows` (m,)."""
        return Ways(self.paths[rows], self.speeds[rows], self.nats[rows])

    def resampled(self, rng: np.random.RandomState) -> "Ways":
        """Return as many ways, drawn anew where few of them count; or else the same.

        Those of a place that is believed are drawn in proportion to a root of that belief and keep the rest of it as
        their nats. In proportion to the belief itself, a place where nothing is heard for a minute would lose all.
        """
        shares, count, squares = self.shares, len(self.nats), squares_of(self.paths[:, -1], _PLACE)
        held = np.maximum(np.bincount(squares, weights=shares)[squares], _NOTHING)
        chances = shares * held ** (_ROOT - 1.0)
        chances /= chances.sum()
        if 1.0 / (chances**2).sum() >= _UNEVEN * count:
            return self
        chosen = np.searchsorted(np.cumsum(chances), (rng.rand() + np.arange(count)) / count)
        chosen = np.minimum(chosen, count - 1)
        nats = (1.0 - _ROOT) * np.log(held[chosen])
        return Ways(self.paths.take(chosen, axis=0), self.speeds[chosen], nats - nats.max())

    def continued(self, ends: np.ndarray, speeds: np.ndarray, longest: int) -> "Ways":
        """Return the ways with places (n, 2) at the next node and `speeds` (n, 2) there; no longer than `longest`."""
        paths = np.concatenate([self.paths[:, -longest + 1 :], ends[:, np.newaxis]], axis=1)
        return Ways(paths, speeds, self.nats)

    def believed(self, nats: np.ndarray) -> "Ways":
        """Return the ways after `nats` (n,) speak for them."""
        total = self.nats + nats
        return self._replace(nats=total - total.max())


def squares_of(places: np.ndarray, side: float) -> np.ndarray:
    """Return the number (n,), from 0 on, of the square of a grid that each of `places` (n, 2) lies in. side: m."""
    cells = np.floor(places / side).astype(np.int64)
    return np.unique(cells, axis=0, return_inverse=True)[1].ravel()


def begun(count: int, place: np.ndarray, speed: float, rng: np.random.RandomState) -> Ways:
    """Return `count` ways that begin at `place` (2,): half of them at rest, half at about `speed` [m/s]."""
    deviations = np.where(rng.rand(count, 1) < 0.5, HELD_SPEED, speed)
    return Ways(np.tile(place, (count, 1, 1)), deviations * rng.normal(size=(count, 2)), np.zeros(count))
