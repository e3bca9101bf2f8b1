"""Where fixes put the map: offset and azimuth by weighted least squares, with what the compass or a map file knows.

The errors of a receiver last for minutes, so that many fixes of one minute tell little more than one; those of the path
grow as in a random walk, so that what the path is off at a fix it mostly is off beside it too, and the fix takes that
away. Both are in the covariance of how far fixes and path lie apart.
"""

from typing import NamedTuple, Tuple

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from georeferencing.fixes import PlacedFixes
from georeferencing.origin import EAST_DEG, Origin, moved_with_origin
from node_support.geometry import rotated, wrapped

COMPASS_DEVIATION = np.radians(3.0)  # of a compass that was calibrated, with how well it is mounted
_NOT_KNOWN = np.pi  # rad, deviation of an azimuth of which nothing is known
_NOWHERE = 1e12  # m^2, variance of a place of which nothing is known
_CORRELATION_TIME = 100.0  # s, of a receiver's errors at the surface: reflections and the air change within minutes
_LASTING = 0.9  # of their variance; the rest differs from fix to fix
_MOST_FIXES = 300  # more of the same minutes tell nothing more
_ROUNDS = 15
_MIDDLE, _FARTHEST = 1.386, 13.8  # squared distance in deviations that 50 % and 0.1 % exceed, in two axes
_STARTS = np.radians(np.arange(-180.0, 180.0, 30.0))
_CONTRADICTS = 3.0  # deviations


class Adjusted(NamedTuple):
    """origin: with its covariance. used: number of fixes. outliers: number of those that lie apart from the others.
    note: what else is to be said, empty where there is nothing. gains: (3, 2, n), by which the origin follows n fixes,
    east and north; variances: (n,) m^2, of each coordinate of the path at these.
    """

    origin: Origin
    used: int = 0
    outliers: int = 0
    note: str = ""
    gains: np.ndarray = np.zeros((3, 2, 0))
    variances: np.ndarray = np.zeros(0)

    def covariances(self, places: np.ndarray, variances: np.ndarray) -> np.ndarray:
        """Return how well the path is known on the Earth: (k, 2, 2) m^2, east and north.

        places: (k, >= 2) x y [m] of it in map. variances: (k,) m^2, of each coordinate of these in map.
        """
        jacobian = self.origin.jacobian(places)
        alike = np.minimum.outer(variances, self.variances)
        shared = jacobian @ np.einsum("pan,kn->kpa", self.gains, alike)
        of_path = variances[:, np.newaxis, np.newaxis] * np.eye(2)
        of_origin = jacobian @ self.origin.covariance @ jacobian.transpose(0, 2, 1)
        return of_path + of_origin - shared - shared.transpose(0, 2, 1)


def of_compass(fixes: PlacedFixes, azimuth_deg: float, deviation: float = COMPASS_DEVIATION) -> Origin:
    """Return what is known without fixes (n > 0) where a compass tells the azimuth of the x axis: a guess of the place.

    deviation: of the azimuth, rad; infinite where nothing tells it.
    """
    turned = Origin(*fixes.degrees[0], azimuth_deg)
    place = turned.degrees(-fixes.places[:1])[0]
    return Origin(*place, azimuth_deg, np.diag([_NOWHERE, _NOWHERE, min(deviation, _NOT_KNOWN) ** 2]))


def adjusted(fixes: PlacedFixes, known: Origin) -> Adjusted:
    """Return where fixes (n > 0) put the map, of which something is known before, with its covariance.

    Where they contradict its azimuth, it is left out and the note says so.
    """
    found = _adjusted(fixes, known)
    free = _adjusted(fixes, of_compass(fixes, known.azimuth_deg, _NOT_KNOWN))
    turn = abs(wrapped(free.origin.yaw - known.yaw))
    if turn**2 <= _CONTRADICTS**2 * (free.origin.covariance[2, 2] + known.covariance[2, 2]):
        return found
    azimuths = f"azimuth {free.origin.azimuth_deg:.0f}, not {known.azimuth_deg:.0f}"
    return free._replace(note=f"the fixes put the x axis at {azimuths}; they count")


def _adjusted(fixes: PlacedFixes, known: Origin) -> Adjusted:
    """Solve for east and north of the map's origin [m] and yaw in the plane of the known place."""
    there = Origin(known.latitude_deg, known.longitude_deg).points(fixes.degrees)
    starts = np.array([known.yaw]) if known.covariance[2, 2] < _NOT_KNOWN**2 else _STARTS
    pose, squares = _robust(fixes, there, starts, known.covariance[2, 2])
    # A receiver whose fixes scatter more than it says is believed as much less.
    scale = max(float(np.median(squares)) / _MIDDLE, 1.0)
    inliers = np.flatnonzero(squares <= _FARTHEST * scale)
    chosen = inliers[np.unique(np.linspace(0, len(inliers) - 1, _MOST_FIXES).astype(int))]
    pose, covariance, gains = _least_squares(fixes.take(chosen), there[chosen], pose, scale, known)
    place = Origin(known.latitude_deg, known.longitude_deg).degrees(pose[np.newaxis, :2])[0]
    azimuth = float(EAST_DEG - np.degrees(wrapped(pose[2])))
    origin, outliers = Origin(*place, azimuth, covariance), len(fixes) - len(inliers)
    return Adjusted(origin, len(inliers), outliers, "", gains, fixes.variances[chosen])


def _robust(fixes: PlacedFixes, there: np.ndarray, yaws: np.ndarray, variance: float) -> Tuple[np.ndarray, np.ndarray]:
    """Return pose (3,) and squared distances (n,) in deviations of the likeliest fit in which jumps hardly count.

    yaws: (s,) rad, each expected with a variance, from which fits begin.
    """
    variances = fixes.deviations**2 + fixes.variances[:, np.newaxis]
    poses = np.column_stack([np.median(there - rotated(fixes.places, yaws[:, np.newaxis]), axis=1), yaws])
    for _ in range(_ROUNDS):
        residuals, jacobian = _residuals(fixes, there, poses)
        squares = (residuals**2 / variances).sum(axis=2)
        weights = 1.0 / (1.0 + squares / _FARTHEST)[..., np.newaxis] / variances
        weighted = weights[..., np.newaxis] * jacobian
        information = np.einsum("snak,snal->skl", weighted, jacobian)
        pull = np.einsum("snak,sna->sk", weighted, residuals)
        information[:, 2, 2] += 1.0 / variance
        pull[:, 2] += (yaws - poses[:, 2]) / variance
        poses = poses + np.linalg.solve(information, pull[..., np.newaxis])[..., 0]
    squares = (_residuals(fixes, there, poses)[0] ** 2 / variances).sum(axis=2)
    best = np.log1p(squares / _FARTHEST).sum(axis=1).argmin()
    return poses[best], squares[best]


def _least_squares(
    fixes: PlacedFixes, there: np.ndarray, pose: np.ndarray, scale: float, known: Origin
) -> Tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return pose (3,), covariance (3, 3) and gains (3, 2, n) with the errors' correlation and what is known before."""
    apart = np.abs(fixes.times[:, np.newaxis] - fixes.times)
    lasting = _LASTING * np.exp(-apart / _CORRELATION_TIME) + (1.0 - _LASTING) * np.eye(len(fixes))
    walked = np.minimum.outer(fixes.variances, fixes.variances)
    factors = [cho_factor(scale * np.outer(axis, axis) * lasting + walked) for axis in fixes.deviations.T]
    before, expected = np.linalg.inv(known.covariance), np.array([0.0, 0.0, known.yaw])
    for _ in range(_ROUNDS):
        residuals, jacobian = _residuals(fixes, there, pose)
        ahead = expected - pose
        ahead[2] = wrapped(ahead[2])
        weighted = np.stack([cho_solve(factor, jacobian[:, axis]) for axis, factor in enumerate(factors)], axis=1)
        covariance = np.linalg.inv(before + np.einsum("nak,nal->kl", jacobian, weighted))
        pull = before @ ahead + np.einsum("nak,na->k", weighted, residuals)
        pose = pose + covariance @ pull
    return pose, covariance, np.einsum("kl,nal->kan", covariance, weighted)


def _residuals(fixes: PlacedFixes, there: np.ndarray, poses: np.ndarray) -> Tuple[np.ndarray, np.ndarray]:
    """Return how far (..., n, 2) the fixes lie from the path, east and north [m], if the map lies at `poses` (..., 3).

    And the jacobian (..., n, 2, 3) by these.
    """
    turned = rotated(fixes.places, poses[..., 2, np.newaxis])
    return there - poses[..., np.newaxis, :2] - turned, moved_with_origin(turned)
