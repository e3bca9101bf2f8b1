"""Refines a state so that the points lie where the local distributions expect them (thesis 6.3, all at once)."""

from dataclasses import dataclass

import numpy as np

from mlsm_manager.scan_matching.distributions import LocalDistributions
from mlsm_manager.scan_matching.point_equations import NARROWEST, Normal, PointEquations
from mlsm_manager.scan_matching.residual_covariance import PointEvidence, residual_covariance
from mlsm_manager.scan_matching.scan_path import POSE, PlanarMotion
from node_support.geometry import squares_of

_SCALES = (8.0, 4.0, NARROWEST)  # of the robust kernel, as the iterations go on: the first for a start one cell off
_ITERATIONS_PER_SCALE = 4
_CLUSTER = 3.0  # m: echoes of one surface within it are compared with the same window of the map and err alike
_GREATEST_INFLATION = 30.0  # 150 echoes of five clusters are worth five points at least
_LAST_STEP = 0.1  # standard deviations: a smaller step changes nothing that a fix tells
_LEAST_WEIGHT = 1e-9  # keeps an average defined where no point has a weight


@dataclass(frozen=True)
class PriorState:
    """Mean (8,) and information (8, 8) of the state before the scan, as in scan_path."""

    mean: np.ndarray
    information: np.ndarray

    def prior_cost(self, theta: np.ndarray) -> float:
        """Return half the squared Mahalanobis distance of a state (8,) from the mean."""
        difference = theta - self.mean
        return float(difference @ self.information @ difference) / 2.0


@dataclass(frozen=True)
class Fit:
    """Where Gauss-Newton ended.

    theta: (8,). covariance: (8, 8), prior included. log_likelihood_gain: nat, of the points over no correspondences,
    where points are taken as independent; `inflation` of them are worth one. prior_cost: nat, minus the prior's
    log-likelihood. inliers: (n,) bool, points that lie on a surface of the map. distances: (n,) m from the nearest
    block. converged: whether the last step was small.
    """

    theta: np.ndarray
    covariance: np.ndarray
    log_likelihood_gain: float
    inflation: float
    prior_cost: float
    inliers: np.ndarray
    distances: np.ndarray
    iterations: int
    converged: bool

    def gain(self, inflation: float) -> float:
        """Return the log-posterior gain [nat]; fits are compared with one `inflation` for all of them."""
        return self.log_likelihood_gain / inflation - self.prior_cost


class Refiner:
    """Minimises the points' robust squared Mahalanobis distances plus the prior's.

    The robust kernel narrows as the iterations go on, until a step is below a tenth of a standard deviation. Points
    that lie near each other in the map err alike; the information is divided by what the sums of their gradients over
    clusters of 3 m show of that (a design effect), so that the prior keeps its honest share.
    """

    def __init__(
        self, motion: PlanarMotion, target: LocalDistributions, prior: PriorState, range_scale_deviation: float
    ) -> None:
        """`motion` has at least one point; `range_scale_deviation` is relative, 0 where ranges are certain."""
        self._prior = prior
        self.points = PointEquations(motion, target, prior.mean, range_scale_deviation)

    def refine(self, start: np.ndarray, max_iterations: int) -> Fit:
        """Return the fit found from `start` (8,)."""
        theta, narrowest = np.array(start, dtype=np.float64), len(_SCALES) - 1
        index, iteration, converged = 0, 0, False
        while iteration < max_iterations and not converged:
            iteration += 1
            normal = self.points.normal(theta, _SCALES[index])
            inflation = self._design_effect(normal) if index == narrowest else 1.0
            points_information, gradient = self.points.weighed(normal, inflation)
            information = points_information + self._prior.information
            step = -np.linalg.solve(information, gradient + self._prior.information @ (theta - self._prior.mean))
            theta = theta + step
            small = bool(step @ information @ step < _LAST_STEP**2)
            converged = small and index == narrowest
            if small or iteration % _ITERATIONS_PER_SCALE == 0:
                index = min(index + 1, narrowest)
        normal = self.points.normal(theta, NARROWEST)
        inflation = self._design_effect(normal)
        covariance = np.linalg.inv(self.points.weighed(normal, inflation)[0] + self._prior.information)
        return Fit(
            theta, covariance, normal.log_likelihood_gain, inflation, self._prior.prior_cost(theta), normal.on_surface,
            normal.correspondences.distances, iteration, converged,
        )  # fmt: skip

    def gains(self, fit: Fit, moves: np.ndarray) -> np.ndarray:
        """Return (k,) what `fit.gain` would be if it had ended at its state moved by `moves` (k, 3)."""
        log_likelihood_gains = self.points.log_likelihood_gains(fit.theta, moves)
        moved = np.tile(fit.theta, (len(moves), 1))
        moved[:, POSE] += moves
        return log_likelihood_gains / fit.inflation - np.array([self._prior.prior_cost(theta) for theta in moved])

    def residual_covariance(self, fit: Fit) -> np.ndarray:
        """Return the covariance (8, 8) of a fit as its residuals tell it, prior included."""
        points, normal = self.points, self.points.normal(fit.theta, NARROWEST)
        gain, _ = points.scale_gain(normal, fit.inflation)
        # A map of t scans averages the noise of its points, and the residuals show s^2 (1 + 1/t) per point. The error
        # of the pose at which it was laid stays that of one scan, s^2: (1 - 1/t) of it are hidden.
        shares = points.map_share(normal.correspondences.nearest)
        hidden = max(2.0 * float(np.average(shares, weights=normal.weight + _LEAST_WEIGHT)) - 1.0, 0.0)
        clusters = squares_of(normal.correspondences.world, _CLUSTER)
        evidence = PointEvidence(*points.evidence(normal, gain, fit.inflation), clusters, hidden)

        def gradient(theta: np.ndarray) -> np.ndarray:
            return points.gradient(theta, gain) / fit.inflation

        return residual_covariance(fit.theta, evidence, gradient, self._prior.information)

    def _design_effect(self, normal: Normal) -> float:
        cluster = squares_of(normal.correspondences.world, _CLUSTER)
        sums = np.stack([np.bincount(cluster, weights=column) for column in normal.gradient.T], axis=1)
        whitening = np.linalg.inv(normal.information + self._prior.information)
        independent = max(float(np.trace(whitening @ normal.information)), 1e-9)
        return float(np.clip(np.trace(whitening @ (sums.T @ sums)) / independent, 1.0, _GREATEST_INFLATION))
