"""Refines a state so that the points lie where the local distributions expect them (thesis 6.3 in one step)."""

from dataclasses import dataclass
from typing import Tuple

import numpy as np

from mlsm_manager.matching.distributions import LocalDistributions
from mlsm_manager.matching.planar_motion import STATES, PlanarMotion
from mlsm_manager.matching.robust import geman_mcclure

SCALES = (8.0, 4.0, 2.5)
_CLUSTER = 3.0
_LAST_STEP = 1e-3
_INLIER = 3.0


@dataclass(frozen=True)
class PriorState:
    """Mean (8,) and information (8, 8) of the state before the scan."""

    mean: np.ndarray
    information: np.ndarray


@dataclass(frozen=True)
class Fit:
    """Where Gauss-Newton ended.

    theta: (8,). data: (8, 8) information that the points gave, after allowing for their correlation.
    covariance: (8, 8), prior included. cost: mean robust cost of a point, 0 (on the map) to 1, without the prior.
    weights: (n,) robust weights. distances: (n,) m to the nearest block's distribution. converged: the last step was small.
    """

    theta: np.ndarray
    data: np.ndarray
    covariance: np.ndarray
    cost: float
    weights: np.ndarray
    distances: np.ndarray
    inliers: np.ndarray
    iterations: int
    converged: bool


def refine(
    motion: PlanarMotion,
    point_weights: np.ndarray,
    target: LocalDistributions,
    start: np.ndarray,
    prior: PriorState,
    max_iterations: int,
) -> Fit:
    """Minimise the points' robust squared Mahalanobis distances plus the prior's, from `start` (8,).

    The robust kernel narrows as the iterations go on. Points that lie near each other in the map err alike; the
    information is divided by what their gradients' sum over clusters of 3 m shows of that (a design effect), so that
    the prior keeps its honest share.
    """
    theta, inflation, scale_index = np.array(start, dtype=np.float64), 1.0, 0
    converged = False
    iteration = 0
    for iteration in range(1, max_iterations + 1):
        normal = _normal_equations(motion, point_weights, target, theta, SCALES[scale_index])
        if scale_index == len(SCALES) - 1:
            inflation = _design_effect(normal, prior)
        information = normal.information / inflation + prior.information
        gradient = normal.gradient.sum(axis=0) / inflation + prior.information @ (theta - prior.mean)
        step = -np.linalg.solve(information, gradient)
        theta = theta + step
        small = _is_small(step, motion)
        if small and scale_index == len(SCALES) - 1:
            converged = True
            break
        if small or iteration % 4 == 0:
            scale_index = min(scale_index + 1, len(SCALES) - 1)
    return _fit(motion, point_weights, target, theta, prior, iteration, converged)


@dataclass(frozen=True)
class _Normal:
    information: np.ndarray
    gradient: np.ndarray
    world: np.ndarray
    squared: np.ndarray
    weights: np.ndarray
    distances: np.ndarray


def _normal_equations(
    motion: PlanarMotion, point_weights: np.ndarray, target: LocalDistributions, theta: np.ndarray, scale: float
) -> _Normal:
    world = motion.points(theta)
    distances, nearest = target.nearest(world)
    residual = world - target.mean[nearest]
    weighted = np.einsum("nab,nb->na", target.information[nearest], residual)
    squared = np.einsum("na,na->n", residual, weighted)
    weights = point_weights * geman_mcclure(squared, scale) * (distances < _gate(scale))
    jacobian = motion.point_jacobian(theta)
    lever = np.einsum("nab,nbs->nas", target.information[nearest], jacobian)
    information = np.einsum("n,nas,nat->st", weights, jacobian, lever)
    gradient = weights[:, np.newaxis] * np.einsum("nas,na->ns", jacobian, weighted)
    return _Normal(information, gradient, world, squared, weights, distances)


def _gate(scale: float) -> float:
    return 0.75 * scale


def _design_effect(normal: _Normal, prior: PriorState) -> float:
    cell = np.floor(normal.world / _CLUSTER).astype(np.int64)
    _, cluster = np.unique(cell, axis=0, return_inverse=True)
    cluster = cluster.reshape(-1)
    sums = np.stack([np.bincount(cluster, weights=column) for column in normal.gradient.T], axis=1)
    shared = sums.T @ sums
    whitening = np.linalg.inv(normal.information + prior.information)
    return float(np.clip(np.trace(whitening @ shared) / max(np.trace(whitening @ normal.information), 1e-9), 0.3, 30.0))


def _is_small(step: np.ndarray, motion: PlanarMotion) -> bool:
    seconds = motion.beam_times[-1] - motion.beam_times[0]
    lengths = np.array([1.0, 1.0, 20.0, seconds, seconds, 20.0 * seconds, 1.0, 1.0])
    return bool(np.abs(step * lengths).max() < _LAST_STEP)


def _fit(
    motion: PlanarMotion,
    point_weights: np.ndarray,
    target: LocalDistributions,
    theta: np.ndarray,
    prior: PriorState,
    iterations: int,
    converged: bool,
) -> Fit:
    normal = _normal_equations(motion, point_weights, target, theta, SCALES[-1])
    data = normal.information / _design_effect(normal, prior)
    covariance = np.linalg.inv(data + prior.information)
    inliers = (normal.squared < _INLIER**2) & (normal.distances < _gate(SCALES[-1]))
    cost, used = robust_cost(normal.squared, inliers, point_weights)
    return Fit(theta, data, covariance, cost, normal.weights, normal.distances, used, iterations, converged)


def robust_cost(squared: np.ndarray, near: np.ndarray, weights: np.ndarray) -> Tuple[float, np.ndarray]:
    """Return the mean Geman-McClure cost, 1 for points that are not `near` the map, and `near` itself."""
    cost = squared / (squared + SCALES[-1] ** 2)
    return float(np.average(np.where(near, cost, 1.0), weights=weights)), near


assert STATES == 8
