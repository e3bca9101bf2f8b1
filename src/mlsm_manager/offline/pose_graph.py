"""Smooths all keyframes at once: sparse Gauss-Newton over relative poses (Lu and Milios 1997, Kuemmerle et al. 2011).

The unknowns are the pose of every keyframe, T_map_base, and two errors of the odometry that last: the relative error of
its distances and the angle by which their direction is off. The first keyframe stays where it is.
"""

from dataclasses import dataclass
from typing import List, Tuple

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import spsolve

from node_support.geometry.planar import composed, inverse, rotated, wrapped

_MOST_ITERATIONS = 30
_LAST_STEP = 1e-6
_FIXED = 1e12
_KERNEL = 2.0


@dataclass(frozen=True)
class RelativePoses:
    """Edges between keyframes: what was measured of T_first_second.

    first, second: (e,) indices. measured: (e, 3) x y [m] yaw [rad]. information: (e, 3, 3), inverse covariances.
    by_odometry: (e,) bool, whether the lasting errors of the odometry are in it.
    """

    first: np.ndarray
    second: np.ndarray
    measured: np.ndarray
    information: np.ndarray
    by_odometry: np.ndarray

    def __len__(self) -> int:
        return len(self.first)


@dataclass(frozen=True)
class UnaryFactors:
    """What is known without the edges.

    headings: (k,) rad from the compass; heading_information: 1/rad^2 of each of them, 0 without a compass.
    motion_information: (2,) of the relative error of distances and of the direction [rad], both expected to be 0.
    """

    headings: np.ndarray
    heading_information: float
    motion_information: np.ndarray


@dataclass(frozen=True)
class Smoothed:
    """poses: (k, 3). motion: (2,) error of the distances and of their direction. cost: half the weighted squares."""

    poses: np.ndarray
    motion: np.ndarray
    cost: float


def smoothed(poses: np.ndarray, edges: RelativePoses, unary: UnaryFactors) -> Smoothed:
    """Return the most likely poses (k, 3), starting from `poses`; edges that disagree with the rest count less."""
    state = np.append(np.asarray(poses, dtype=np.float64).ravel(), [0.0, 0.0])
    cost = np.inf
    for _ in range(_MOST_ITERATIONS):
        information, gradient, cost = _normal(state, edges, unary)
        step = -spsolve(information, gradient)
        state = state + step
        if np.abs(step).max() < _LAST_STEP:
            break
    return Smoothed(state[:-2].reshape(-1, 3), state[-2:], cost)


def _normal(
    state: np.ndarray, edges: RelativePoses, unary: UnaryFactors
) -> Tuple[sparse.csc_matrix, np.ndarray, float]:
    residual, jacobian = _edges(state, edges)
    squared = np.einsum("ea,eab,eb->e", residual, edges.information, residual)
    weight = 1.0 / (1.0 + squared / (3.0 * _KERNEL**2))
    whitening = sparse.block_diag(list(edges.information * weight[:, np.newaxis, np.newaxis]), format="csr")
    weighted = jacobian.T @ whitening
    diagonal, gradient = _unary(state, unary)
    information = (weighted @ jacobian + sparse.diags(diagonal)).tocsc()
    robust_cost = 1.5 * _KERNEL**2 * np.log1p(squared / (3.0 * _KERNEL**2)).sum()
    return information, weighted @ residual.ravel() + gradient, float(robust_cost)


def _edges(state: np.ndarray, edges: RelativePoses) -> Tuple[np.ndarray, sparse.csr_matrix]:
    """Return residuals (e, 3), each in the frame of its first keyframe, and their derivative (3 e, states)."""
    poses, (scale, direction) = state[:-2].reshape(-1, 3), state[-2:]
    first, second = poses[edges.first], poses[edges.second]
    relative = composed(inverse(first), second)
    turned = rotated(edges.measured[:, :2], np.where(edges.by_odometry, direction, 0.0))
    stretch = np.where(edges.by_odometry, 1.0 + scale, 1.0)[:, np.newaxis]
    residual = np.column_stack([relative[:, :2] - stretch * turned, wrapped(relative[:, 2] - edges.measured[:, 2])])
    return residual, _jacobian(state.size, edges, relative, np.ascontiguousarray(first[:, 2]), turned, stretch)


def _jacobian(
    states: int,
    edges: RelativePoses,
    relative: np.ndarray,
    heading: np.ndarray,
    turned: np.ndarray,
    stretch: np.ndarray,
) -> sparse.csr_matrix:
    count = len(edges)
    blocks = np.zeros((count, 3, 8))
    cos, sin = np.cos(heading), np.sin(heading)
    to_first = np.stack([np.stack([cos, sin], axis=-1), np.stack([-sin, cos], axis=-1)], axis=-2)
    blocks[:, :2, 0:2], blocks[:, :2, 3:5] = -to_first, to_first
    blocks[:, 0, 2], blocks[:, 1, 2] = relative[:, 1], -relative[:, 0]
    blocks[:, 2, 2], blocks[:, 2, 5] = -1.0, 1.0
    owned = edges.by_odometry[:, np.newaxis]
    blocks[:, :2, 6] = np.where(owned, -turned, 0.0)
    blocks[:, :2, 7] = np.where(owned, -stretch * np.column_stack([-turned[:, 1], turned[:, 0]]), 0.0)
    axes = np.arange(3)
    columns = np.concatenate(
        [
            3 * edges.first[:, np.newaxis] + axes,
            3 * edges.second[:, np.newaxis] + axes,
            np.broadcast_to([states - 2, states - 1], (count, 2)),
        ],
        axis=1,
    )
    rows = np.broadcast_to(np.arange(3 * count).reshape(count, 3, 1), blocks.shape)
    columns = np.broadcast_to(columns[:, np.newaxis], blocks.shape)
    return sparse.csr_matrix((blocks.ravel(), (rows.ravel(), columns.ravel())), shape=(3 * count, states))


def _unary(state: np.ndarray, unary: UnaryFactors) -> Tuple[np.ndarray, np.ndarray]:
    """Return information (states,) and gradient (states,) of what is known without the edges."""
    diagonal, gradient = np.zeros(state.size), np.zeros(state.size)
    diagonal[2:-2:3] = unary.heading_information
    gradient[2:-2:3] = unary.heading_information * wrapped(state[2:-2:3] - unary.headings)
    diagonal[-2:] = unary.motion_information
    gradient[-2:] = unary.motion_information * state[-2:]
    diagonal[:2] = _FIXED
    if unary.heading_information == 0.0:
        diagonal[2] = _FIXED
    return diagonal, gradient


def joined(parts: List[RelativePoses]) -> RelativePoses:
    """Return all edges of several sets as one."""
    names = ("first", "second", "measured", "information", "by_odometry")
    return RelativePoses(*[np.concatenate([getattr(part, name) for part in parts]) for name in names])
