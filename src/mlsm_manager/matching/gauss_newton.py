"""Refines a state so that the points lie where the local distributions expect them (thesis 6.3, all at once)."""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from mlsm_manager.matching.distributions import LocalDistributions
from mlsm_manager.matching.planar_motion import PlanarMotion
from mlsm_manager.matching.residual_covariance import PointEvidence, residual_covariance
from mlsm_manager.matching.robust import geman_mcclure, geman_mcclure_cost

SCALES = (8.0, 4.0, 2.5)
_GATE = 0.75
_ITERATIONS_PER_SCALE = 4
_CLUSTER = 3.0
_GREATEST_INFLATION = 30.0
_LAST_STEP = 0.1
_LEAST_IMPORTANCE = 1e-9
_NEIGHBOURS = 12
INLIER = 3.0


@dataclass(frozen=True)
class PriorState:
    """Mean (8,) and information (8, 8) of the state before the scan, as in planar_motion."""

    mean: np.ndarray
    information: np.ndarray

    def objection(self, theta: np.ndarray) -> float:
        """Return half the squared Mahalanobis distance of a state from the mean."""
        difference = theta - self.mean
        return float(difference @ self.information @ difference) / 2.0


@dataclass(frozen=True)
class Fit:
    """Where Gauss-Newton ended.

    theta: (8,). covariance: (8, 8), prior included. support: by how many nats the points, taken as independent, prefer
    this place to one where they meet nothing; `inflation` of them are worth one. objection: nats by which the prior
    argues against it. inliers: (n,) bool, points that lie on a surface of the map. distances: (n,) m from the nearest
    block. converged: whether the last step was small.
    """

    theta: np.ndarray
    covariance: np.ndarray
    support: float
    inflation: float
    objection: float
    inliers: np.ndarray
    distances: np.ndarray
    iterations: int
    converged: bool

    def gain(self, inflation: float) -> float:
        """Return the nats for this place; fits are compared with one `inflation` for all of them."""
        return self.support / inflation - self.objection


@dataclass(frozen=True)
class _Meeting:
    """How the points meet the map: places (n, 2), metric (n, 2, 2), residuals and what each point is worth."""

    world: np.ndarray
    nearest: np.ndarray
    distances: np.ndarray
    metric: np.ndarray
    residual: np.ndarray
    squared: np.ndarray


@dataclass(frozen=True)
class _Normal:
    """Normal equations at a state: information (8, 8), gradient of each point (n, 8), places and residuals.

    jacobian, lever: (n, 2, 8) derivative of each place, and the same times its weighted metric.
    """

    information: np.ndarray
    gradient: np.ndarray
    jacobian: np.ndarray
    lever: np.ndarray
    world: np.ndarray
    squared: np.ndarray
    importance: np.ndarray
    distances: np.ndarray


class Refiner:
    """Minimises the points' robust squared Mahalanobis distances plus the prior's.

    The robust kernel narrows as the iterations go on, until a step is below a tenth of a standard deviation. Points
    that lie near each other in the map err alike; the information is divided by what the sums of their gradients over
    clusters of 3 m show of that (a design effect), so that the prior keeps its honest share.
    """

    def __init__(
        self, motion: PlanarMotion, point_weights: np.ndarray, target: LocalDistributions, prior: PriorState
    ) -> None:
        """`point_weights` is (n,), n > 0."""
        self._motion = motion
        self._point_weights = point_weights
        self._target = target
        self._prior = prior
        spots = motion.points(motion.path(prior.mean))
        self._apart, _ = cKDTree(spots).query(spots, k=np.arange(1, min(_NEIGHBOURS, len(spots)) + 1))

    def refine(self, start: np.ndarray, max_iterations: int) -> Fit:
        """Return the fit found from `start` (8,)."""
        theta, narrowest = np.array(start, dtype=np.float64), len(SCALES) - 1
        index, iteration, converged = 0, 0, False
        while iteration < max_iterations and not converged:
            iteration += 1
            normal = self._normal(theta, SCALES[index])
            inflation = self._design_effect(normal) if index == narrowest else 1.0
            information = normal.information / inflation + self._prior.information
            step = self._step(theta, normal, information, inflation)
            theta = theta + step
            small = bool(step @ information @ step < _LAST_STEP**2)
            converged = small and index == narrowest
            if small or iteration % _ITERATIONS_PER_SCALE == 0:
                index = min(index + 1, narrowest)
        return self._fit(theta, iteration, converged)

    def matched(self, theta: np.ndarray) -> np.ndarray:
        """Return (n,) bool: points that lie on a surface of the map when the state is `theta`."""
        meeting = self._meeting(self._motion.path(theta))
        return (meeting.squared < INLIER**2) & (meeting.distances < _GATE * SCALES[-1])

    def gain(self, theta: np.ndarray, inflation: float) -> float:
        """Return what `Fit.gain` would be if a fit ended at `theta`."""
        meeting = self._meeting(self._motion.path(theta))
        importance = self._importance(meeting, SCALES[-1])
        return _support(importance, meeting.squared) / inflation - self._prior.objection(theta)

    def world(self, theta: np.ndarray) -> np.ndarray:
        """Return the points (n, 2) in map when the state is `theta`."""
        return self._motion.points(self._motion.path(theta))

    def residual_covariance(self, fit: Fit) -> np.ndarray:
        """Return the covariance (8, 8) of a fit as its residuals tell it, prior included."""
        normal = self._normal(fit.theta, SCALES[-1])
        points = PointEvidence(
            normal.gradient / fit.inflation, normal.jacobian.transpose(0, 2, 1) @ normal.lever / fit.inflation,
            _clusters(normal.world), self._hidden_share(normal),
        )  # fmt: skip
        return residual_covariance(
            fit.theta, points, lambda theta: self._gradient(theta) / fit.inflation, self._prior.information
        )

    def _hidden_share(self, normal: _Normal) -> float:
        """Return how much of the map's error the residuals do not show, as a share of the noise that they show.

        A map of t scans averages the noise of its points, and the residuals show s^2 (1 + 1/t) per point. The error of
        the pose at which it was laid stays that of one scan, s^2: (1 - 1/t) of it are hidden.
        """
        _, nearest = self._target.nearest(normal.world)
        share = np.average(self._map_share(nearest), weights=normal.importance + _LEAST_IMPORTANCE)
        return max(2.0 * float(share) - 1.0, 0.0)

    def _gradient(self, theta: np.ndarray) -> np.ndarray:
        return self._normal(theta, SCALES[-1]).gradient.sum(axis=0)

    def _step(self, theta: np.ndarray, normal: _Normal, information: np.ndarray, inflation: float) -> np.ndarray:
        objection = self._prior.information @ (theta - self._prior.mean)
        return -np.linalg.solve(information, normal.gradient.sum(axis=0) / inflation + objection)

    def _meeting(self, path: np.ndarray) -> _Meeting:
        world = self._motion.points(path)
        distances, nearest = self._target.nearest(world)
        residual = world - self._target.mean[nearest]
        metric = _inverse(self._target.covariance[nearest] + self._motion.point_covariance(path))
        squared = np.einsum("na,nab,nb->n", residual, metric, residual)
        return _Meeting(world, nearest, distances, metric, residual, squared)

    def _normal(self, theta: np.ndarray, scale: float) -> _Normal:
        path = self._motion.path(theta)
        meeting = self._meeting(path)
        importance = self._importance(meeting, scale)
        weights = importance * geman_mcclure(meeting.squared, scale)
        jacobian = self._motion.point_jacobian(path, theta)
        lever = (meeting.metric * weights[:, np.newaxis, np.newaxis]) @ jacobian
        information = np.tensordot(jacobian, lever, axes=([0, 1], [0, 1]))
        gradient = np.einsum("nas,na->ns", lever, meeting.residual)
        return _Normal(
            information, gradient, jacobian, lever, meeting.world, meeting.squared, importance, meeting.distances
        )

    def _importance(self, meeting: _Meeting, scale: float) -> np.ndarray:
        share = self._target.weight[meeting.nearest] * self._map_share(meeting.nearest)
        return self._point_weights * share * (meeting.distances < _GATE * scale)

    def _map_share(self, nearest: np.ndarray) -> np.ndarray:
        """Return (n,) the share of the points' information that is left after the map's own noise.

        k points of a scan that are compared with the same m points of the map err by s^2/k + s^2/m together, and the
        fit cannot see the second part.
        """
        window = self._target.window[nearest][:, np.newaxis]
        scan_support = np.exp(-0.5 * (self._apart / window) ** 2).sum(axis=1)
        map_support = self._target.support[nearest]
        return map_support / (map_support + scan_support)

    def _design_effect(self, normal: _Normal) -> float:
        cluster = _clusters(normal.world)
        sums = np.stack([np.bincount(cluster, weights=column) for column in normal.gradient.T], axis=1)
        whitening = np.linalg.inv(normal.information + self._prior.information)
        independent = max(float(np.trace(whitening @ normal.information)), 1e-9)
        return float(np.clip(np.trace(whitening @ (sums.T @ sums)) / independent, 1.0, _GREATEST_INFLATION))

    def _on_surface(self, normal: _Normal) -> np.ndarray:
        return (normal.squared < INLIER**2) & (normal.importance > 0.0)

    def _fit(self, theta: np.ndarray, iterations: int, converged: bool) -> Fit:
        normal = self._normal(theta, SCALES[-1])
        inflation = self._design_effect(normal)
        covariance = np.linalg.inv(normal.information / inflation + self._prior.information)
        support = _support(normal.importance, normal.squared)
        return Fit(
            theta, covariance, support, inflation, self._prior.objection(theta), self._on_surface(normal),
            normal.distances, iterations, converged,
        )  # fmt: skip


def _clusters(world: np.ndarray) -> np.ndarray:
    """Return for points (n, 2) the number (n,) of the square of 3 m that each lies in."""
    cell = np.floor(world / _CLUSTER).astype(np.int64)
    return np.unique(cell[:, 0] * 2**32 + cell[:, 1], return_inverse=True)[1]


def _support(importance: np.ndarray, squared: np.ndarray) -> float:
    saved = SCALES[-1] ** 2 / 2.0 - geman_mcclure_cost(squared, SCALES[-1])
    return float((importance * saved).sum())


def _inverse(matrices: np.ndarray) -> np.ndarray:
    """Return the inverses of symmetric matrices (n, 2, 2)."""
    a, b, d = matrices[:, 0, 0], matrices[:, 0, 1], matrices[:, 1, 1]
    result = np.empty_like(matrices)
    result[:, 0, 0], result[:, 1, 1] = d, a
    result[:, 0, 1] = result[:, 1, 0] = -b
    return result / (a * d - b * b)[:, np.newaxis, np.newaxis]
