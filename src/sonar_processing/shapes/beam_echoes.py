"""A scan's echoes: the run of bins that one surface fills in one beam, taken together as one point."""

from dataclasses import dataclass

import numpy as np

from sonar_processing.cloud import IntensityCloud

_SAME_POINT = 1e-6


@dataclass(frozen=True)
class BeamEchoes:
    """The echoes of one scan, seen from above.

    points: (m, 2) float64, x y [m]: the middle of each echo, weighted by strength.
    weights: (m,) number of cloud points in each. lengths: (m,) from the nearest point of each to the farthest, m.
    members: (k,) indices of the finite points of the cloud; owner: (k,) the echo that each of them belongs to.
    time_stamps: (m,) float64, when each echo's beam was taken, s, without the sign that tells still from moving.
    """

    points: np.ndarray
    weights: np.ndarray
    lengths: np.ndarray
    members: np.ndarray
    owner: np.ndarray
    time_stamps: np.ndarray

    def __len__(self) -> int:
        return len(self.points)

    def strong(self, share: float) -> np.ndarray:
        """Return the indices (k,) of the echoes with at least `share` times as many points as the usual one.

        Half of all points belong to echoes as large as the usual one or larger: noise, many echoes of one bin each,
        does not change it.
        """
        if not len(self):
            return np.arange(0)
        sizes = np.sort(self.weights)
        usual = sizes[np.searchsorted(np.cumsum(sizes), sizes.sum() / 2.0)]
        return np.flatnonzero(self.weights >= share * usual)


def beam_echoes(cloud: IntensityCloud, gap: float) -> BeamEchoes:
    """Return the echoes of a cloud whose points come beam by beam and with growing range, as all stages keep them.

    Neighbours of one beam that are at most `gap` [m] apart belong together; with 0 every point is an echo of its own.
    A pulse fills many bins, and a wide beam smears an inclined surface over more: the surface is near the middle of
    them, not at the nearest one, and a beam that hits squarely must not outvote those that graze.
    """
    members = np.flatnonzero(cloud.valid)
    points = cloud.points[members].astype(np.float64)
    stamps = np.abs(cloud.time_stamps[members])
    starts = np.flatnonzero(_begins(points, stamps, gap))
    owner = np.repeat(np.arange(len(starts)), np.diff(np.append(starts, len(points))))
    strengths = np.maximum(points[:, 3], _SAME_POINT)[:, np.newaxis]
    sums = _sums(np.hstack([points[:, :2] * strengths, strengths]), starts)
    weights = np.bincount(owner, minlength=len(starts))
    lengths = np.linalg.norm(points[starts + weights - 1, :3] - points[starts, :3], axis=1)
    return BeamEchoes(sums[:, :2] / sums[:, 2:], weights, lengths, members, owner, stamps[starts])


def _begins(points: np.ndarray, stamps: np.ndarray, gap: float) -> np.ndarray:
    begins = np.ones(len(points), dtype=bool)
    steps = np.linalg.norm(np.diff(points[:, :3], axis=0), axis=1)
    begins[1:] = (stamps[1:] != stamps[:-1]) | (steps > gap)
    return begins


def _sums(values: np.ndarray, starts: np.ndarray) -> np.ndarray:
    return np.add.reduceat(values, starts, axis=0) if len(starts) else np.empty((0, values.shape[1]))
