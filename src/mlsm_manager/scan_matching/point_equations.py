"""What the points of a scan say of the state: residuals, gradients and information, linearised at one state."""

from dataclasses import dataclass
from functools import cached_property
from typing import Tuple

import numpy as np
from scipy.spatial import cKDTree

from mlsm_manager.scan_matching.distributions import LocalDistributions
from mlsm_manager.scan_matching.scan_path import POSITION, STATES, PlanarMotion
from node_support.geometry import rotated

NARROWEST = 2.5  # standard deviations at which the robust kernel bends at the end, by which places are compared
_INLIER = 3.0  # standard deviations: of a planar Gaussian, 99 % lie within three
_GATE = 0.75  # m per standard deviation of the kernel: no block of another surface within 6 m at first, 1.9 m at last
_NEIGHBOURS = 12  # points of a scan that can share a window of the map: 2.5 m hold five of a wall on either side


@dataclass(frozen=True)
class Correspondences:
    """The block of the map that each point is compared with, and how far it lies from it.

    world: (n, 2) places in map. arms: (n, 2) m from the vehicle to them. nearest: (n,) their blocks, at `distances`
    (n,) m. metric: (n, 2, 2) inverse covariance. residual: (n, 2) m. squared: (n,) the residuals' squared Mahalanobis
    length.
    """

    world: np.ndarray
    arms: np.ndarray
    nearest: np.ndarray
    distances: np.ndarray
    metric: np.ndarray
    residual: np.ndarray
    squared: np.ndarray


@dataclass(frozen=True)
class Normal:
    """Normal equations of the points at a state, where nothing is known of the ranges' scale but that it is 1.

    gradient: (n, 8) of each point. jacobian: (n, 2, 8) derivative of each place by the state. weighted_jacobian: (n, 2,
    8) the same times the weighted metric. weighted_arms: (n, 2) the derivative by the ranges' scale, which is the arms,
    times the weighted metric. weight: (n,) of each point before the robust kernel.
    """

    correspondences: Correspondences
    gradient: np.ndarray
    jacobian: np.ndarray
    weighted_jacobian: np.ndarray
    weighted_arms: np.ndarray
    weight: np.ndarray

    @cached_property
    def information(self) -> np.ndarray:
        """The points' information (8, 8) of the state."""
        return np.tensordot(self.jacobian, self.weighted_jacobian, axes=([0, 1], [0, 1]))

    @property
    def on_surface(self) -> np.ndarray:
        """(n,) bool: points that lie on a surface of the map."""
        return (self.correspondences.squared < _INLIER**2) & (self.weight > 0.0)

    @property
    def log_likelihood_gain(self) -> float:
        """Over no correspondences, nat."""
        return float((self.weight * _saved(self.correspondences.squared)).sum())


class PointEquations:
    """Compares the points of one scan with the local distributions of a map.

    An error of all ranges in proportion is one more unknown and is integrated out: between walls that converge it looks
    like a motion.
    """

    def __init__(
        self, motion: PlanarMotion, target: LocalDistributions, expected: np.ndarray, range_scale_deviation: float
    ) -> None:
        """`expected`: (8,) a state; `range_scale_deviation`: relative, 0 where ranges are certain."""
        self._motion, self._target, self._range_scale_deviation = motion, target, range_scale_deviation
        spots = self.world(expected)
        self._apart, _ = cKDTree(spots).query(spots, k=np.arange(1, min(_NEIGHBOURS, len(spots)) + 1))

    def world(self, theta: np.ndarray) -> np.ndarray:
        """Return the points (n, 2) in map when the state is `theta` (8,)."""
        return self._motion.points(self._motion.path(theta))

    def normal(self, theta: np.ndarray, scale: float) -> Normal:
        """Return the normal equations at `theta` (8,) with a robust kernel of `scale` standard deviations."""
        correspondences = self._at(theta)
        weight = self._weights(correspondences, scale)
        robust = weight * _geman_mcclure(correspondences.squared, scale)
        weighted = correspondences.metric * robust[:, np.newaxis, np.newaxis]
        jacobian = self._motion.point_jacobian(correspondences.arms, theta)
        weighted_jacobian = weighted @ jacobian
        gradient = np.einsum("nas,na->ns", weighted_jacobian, correspondences.residual)
        weighted_arms = np.einsum("nab,nb->na", weighted, correspondences.arms)
        return Normal(correspondences, gradient, jacobian, weighted_jacobian, weighted_arms, weight)

    def matched_shares(self, theta: np.ndarray, moves: np.ndarray) -> np.ndarray:
        """Return (k,) which share of the points lies on a surface when `theta` is moved by `moves` (k, 3)."""
        correspondences = self._moved(theta, moves)
        matched = (correspondences.squared < _INLIER**2) & (correspondences.distances < _GATE * NARROWEST)
        return matched.reshape(len(moves), -1).mean(axis=1)

    def log_likelihood_gains(self, theta: np.ndarray, moves: np.ndarray) -> np.ndarray:
        """Return (k,) log-likelihood gain [nat] over no correspondences, when `theta` is moved by `moves` (k, 3)."""
        correspondences = self._moved(theta, moves)
        each = self._weights(correspondences, NARROWEST) * _saved(correspondences.squared)
        return each.reshape(len(moves), -1).sum(axis=1)

    def weighed(self, normal: Normal, inflation: float) -> Tuple[np.ndarray, np.ndarray]:
        """Return information (8, 8) and gradient (8,) of all points, each worth 1 / `inflation` of one."""
        information, gradient = normal.information / inflation, normal.gradient.sum(axis=0) / inflation
        gain, mixed = self.scale_gain(normal, inflation)
        return information - np.outer(gain, mixed), gradient - gain * _scale_gradient(normal).sum() / inflation

    def scale_gain(self, normal: Normal, inflation: float) -> Tuple[np.ndarray, np.ndarray]:
        """Return (8,) how far the scale's error moves the state's gradient, and (8,) what they have in common."""
        mixed = np.einsum("nas,na->s", normal.weighted_jacobian, normal.correspondences.arms) / inflation
        if self._range_scale_deviation == 0.0:
            return np.zeros_like(mixed), mixed
        by_points = float((normal.weighted_arms * normal.correspondences.arms).sum()) / inflation
        return mixed / (by_points + self._range_scale_deviation**-2), mixed

    def evidence(self, normal: Normal, gain: np.ndarray, inflation: float) -> Tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return gradient (n, 8) and information (n, 8, 8) of each point, and (8, 8) of what is known of the scale.

        gain: (8,) as of scale_gain. All are 1 / `inflation` of what independent points would say; their sums are those
        of `weighed`.
        """
        gradient, jacobian, weighted_jacobian = normal.gradient, normal.jacobian, normal.weighted_jacobian
        of_scale = np.zeros((STATES, STATES))
        if self._range_scale_deviation > 0.0:
            gradient = gradient - _scale_gradient(normal)[:, np.newaxis] * gain
            jacobian = jacobian - normal.correspondences.arms[:, :, np.newaxis] * gain
            weighted_jacobian = weighted_jacobian - normal.weighted_arms[:, :, np.newaxis] * gain
            of_scale = np.outer(gain, gain) / self._range_scale_deviation**2
        return gradient / inflation, jacobian.transpose(0, 2, 1) @ weighted_jacobian / inflation, of_scale

    def gradient(self, theta: np.ndarray, gain: np.ndarray) -> np.ndarray:
        """Return the gradient (8,) of all points at `theta`, less `gain` (8,) times that by the ranges' scale."""
        correspondences = self._at(theta)
        weights = self._weights(correspondences, NARROWEST) * _geman_mcclure(correspondences.squared, NARROWEST)
        force = np.einsum("nab,nb->na", correspondences.metric, correspondences.residual) * weights[:, np.newaxis]
        return self._motion.gradient_of(force, correspondences.arms, theta) - gain * float(
            (force * correspondences.arms).sum()
        )

    def map_share(self, nearest: np.ndarray) -> np.ndarray:
        """Return the share of the points' information that is left after the map's own noise.

        nearest: (k n,), the blocks of the points at k places, one place after the other.
        k points of a scan that are compared with the same m points of the map err by s^2/k + s^2/m together, and the
        fit cannot see the second part.
        """
        window = self._target.window[nearest][:, np.newaxis]
        apart = np.tile(self._apart, (len(nearest) // len(self._apart), 1))
        scan_points = np.exp(-0.5 * (apart / window) ** 2).sum(axis=1)
        map_points = self._target.point_count[nearest]
        return map_points / (map_points + scan_points)

    def _at(self, theta: np.ndarray) -> Correspondences:
        path = self._motion.path(theta)
        world = self._motion.points(path)
        return self._correspondences(world, self._motion.arms(world, path))

    def _moved(self, theta: np.ndarray, moves: np.ndarray) -> Correspondences:
        """Return the correspondences when the pose is moved by `moves` (k, 3): of k times n points in a row."""
        path = self._motion.path(theta)
        world, turn = self._motion.points(path), moves[:, np.newaxis, 2]
        turned = rotated(world - theta[POSITION], turn) + theta[POSITION] + moves[:, np.newaxis, :2]
        arms = rotated(self._motion.arms(world, path), turn)
        return self._correspondences(turned.reshape(-1, 2), arms.reshape(-1, 2))

    def _correspondences(self, world: np.ndarray, arms: np.ndarray) -> Correspondences:
        distances, nearest = self._target.nearest(world)
        residual = world - self._target.mean[nearest]
        metric = _inverse(self._target.covariance[nearest] + self._motion.point_covariance(arms))
        squared = np.einsum("na,nab,nb->n", residual, metric, residual)
        return Correspondences(world, arms, nearest, distances, metric, residual, squared)

    def _weights(self, correspondences: Correspondences, scale: float) -> np.ndarray:
        share = self._target.weight[correspondences.nearest] * self.map_share(correspondences.nearest)
        return share * (correspondences.distances < _GATE * scale)


def _saved(squared: np.ndarray) -> np.ndarray:
    """Return by how much the costs (n,), whose slope the weights are, are below those far off: half of NARROWEST^2."""
    return NARROWEST**2 / 2.0 - 0.5 * squared / (1.0 + squared / NARROWEST**2)


def _scale_gradient(normal: Normal) -> np.ndarray:
    return (normal.weighted_arms * normal.correspondences.residual).sum(axis=1)


def _inverse(matrices: np.ndarray) -> np.ndarray:
    """Return the inverses of symmetric matrices (n, 2, 2)."""
    a, b, d = matrices[:, 0, 0], matrices[:, 0, 1], matrices[:, 1, 1]
    result = np.empty_like(matrices)
    result[:, 0, 0], result[:, 1, 1] = d, a
    result[:, 0, 1] = result[:, 1, 0] = -b
    return result / (a * d - b * b)[:, np.newaxis, np.newaxis]


def _geman_mcclure(squared: np.ndarray, scale: float) -> np.ndarray:
    """Return weights (n,) of squared normalised residuals (n,): 1 at 0, 1/4 at `scale` (Geman and McClure 1985)."""
    return (1.0 + squared / scale**2) ** -2
