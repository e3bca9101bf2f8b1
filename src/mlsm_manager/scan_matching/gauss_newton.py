"""Refines a state so that the points lie where the local distributions expect them (thesis 6.3, all at once)."""

from dataclasses import dataclass

import numpy as np

from mlsm_manager.scan_matching.distributions import LocalDistributions
from mlsm_manager.scan_matching.point_equations import Normal, PointEquations, log_likelihood_gain
from mlsm_manager.scan_matching.residual_covariance import PointEvidence, residual_covariance
from mlsm_manager.scan_matching.scan_path import POSE, PlanarMotion
from mlsm_manager.surface_map.blocks import squares_of

# Standard deviations at which the robust kernel bends: wide enough for a start one search cell off, narrow at the end.
SCALES = (8.0, 4.0, 2.5)
_ITERATIONS_PER_SCALE = 4
# m: echoes of one surface within this distance are compared with the same window of the map and err alike.
_CLUSTER = 3.0
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
        self._motion = motion
        self._prior = prior
        self._points = PointEquations(motion, target, prior.mean, range_scale_deviation)

    def refine(self, start: np.ndarray, max_iterations: int) -> Fit:
        """Return the fit found from `start` (8,)."""
        theta, narrowest = np.array(start, dtype=np.float64), len(SCALES) - 1
        index, iteration, converged = 0, 0, False
        while iteration < max_iterations and not converged:
            iteration += 1
            normal = self._points.normal(theta, SCALES[index])
            inflation = self._design_effect(normal) if index == narrowest else 1.0
            points_information, gradient = self._points.weighed(normal, inflation)
            information = points_information + self._prior.information
            step = -np.linalg.solve(information, gradient + self._prior.information @ (theta - self._prior.mean))
            theta = theta + step
            small = bool(step @ information @ step < _LAST_STEP**2)
            converged = small and index == narrowest
            if small or iteration % _ITERATIONS_PER_SCALE == 0:
                index = min(index + 1, narrowest)
        return self._fit(theta, iteration, converged)

    def matched_shares(self, theta: np.ndarray, moves: np.ndarray) -> np.ndarray:
        """Return (k,) which share of the points lies on the map when the pose of `theta` is moved by `moves` (k, 3)."""
        return self._points.matched_shares(theta, moves, SCALES[-1])

    def gains(self, fit: Fit, moves: np.ndarray) -> np.ndarray:
        """Return (k,) what `fit.gain` would be if it had ended at its state moved by `moves` (k, 3)."""
        log_likelihood_gains = self._points.log_likelihood_gains(fit.theta, moves, SCALES[-1])
        moved = np.tile(fit.theta, (len(moves), 1))
        moved[:, POSE] += moves
        return log_likelihood_gains / fit.inflation - np.array([self._prior.prior_cost(theta) for theta in moved])

    def world(self, theta: np.ndarray) -> np.ndarray:
        """Return the points (n, 2) in map when the state is `theta`."""
        return self._motion.points(self._motion.path(theta))

    def residual_covariance(self, fit: Fit) -> np.ndarray:
        """Return the covariance (8, 8) of a fit as its residuals tell it, prior included."""
        normal = self._points.normal(fit.theta, SCALES[-1])
        gain, _ = self._points.scale_gain(normal, fit.inflation)
        evidence = PointEvidence(
            *self._points.evidence(normal, gain, fit.inflation), squares_of(normal.correspondences.world, _CLUSTER),
            self._hidden_share(normal),
        )  # fmt: skip

        def gradient(theta: np.ndarray) -> np.ndarray:
            return self._points.gradient(theta, SCALES[-1], gain) / fit.inflation

        return residual_covariance(fit.theta, evidence, gradient, self._prior.information)

    def _hidden_share(self, normal: Normal) -> float:
        """Return how much of the map's error the residuals do not show, as a share of the noise that they show.

        A map of t scans averages the noise of its points, and the residuals show s^2 (1 + 1/t) per point. The error of
        the pose at which it was laid stays that of one scan, s^2: (1 - 1/t) of it are hidden.
        """
        shares = self._points.map_share(normal.correspondences.nearest)
        return max(2.0 * float(np.average(shares, weights=normal.weight + _LEAST_WEIGHT)) - 1.0, 0.0)

    def _design_effect(self, normal: Normal) -> float:
        cluster = squares_of(normal.correspondences.world, _CLUSTER)
        sums = np.stack([np.bincount(cluster, weights=column) for column in normal.gradient.T], axis=1)
        whitening = np.linalg.inv(normal.information + self._prior.information)
        independent = max(float(np.trace(whitening @ normal.information)), 1e-9)
        return float(np.clip(np.trace(whitening @ (sums.T @ sums)) / independent, 1.0, _GREATEST_INFLATION))

    def _fit(self, theta: np.ndarray, iterations: int, converged: bool) -> Fit:
        normal = self._points.normal(theta, SCALES[-1])
        inflation = self._design_effect(normal)
        covariance = np.linalg.inv(self._points.weighed(normal, inflation)[0] + self._prior.information)
        return Fit(
            theta, covariance, log_likelihood_gain(normal, SCALES[-1]), inflation,
            self._prior.prior_cost(theta), normal.on_surface, normal.correspondences.distances, iterations, converged,
        )  # fmt: skip
