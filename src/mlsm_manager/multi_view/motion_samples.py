"""Finds how a vehicle moved during a turn of the head of which next to nothing is known beforehand.

Ways that such a vehicle may go are drawn at random; after each part of the turn those live on whose echoes lie on what
was heard before (a particle filter, Gordon, Salmond and Smith 1993).
"""

from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from mlsm_manager.multi_view.motion_search import COMPARED_SCANS, is_known, step_covariance
from mlsm_manager.multi_view.odometry_model import OdometryModel
from mlsm_manager.multi_view.parameters import SurfaceMatching
from mlsm_manager.multi_view.placement import PlacedPoints, place
from mlsm_manager.multi_view.run_log import RunLog
from mlsm_manager.multi_view.state import POSE, State
from mlsm_manager.multi_view.transition import Transition

_WAYS = 1000  # that are drawn: with 600 a tour comes out up to 2 m worse, with 2000 no better
_MOST_POINTS = 50  # of each part; neighbours on a wall say the same
_NATS = 0.4  # that a point on a surface is worth: neighbours share errors
_NEAR = 1.0  # m: about twice the deviation of an echo
_REACH = 3.0  # m from a surface beyond which a point tells nothing
_ALIKE = 1.0  # m by which the ends of ways may differ that count as one
_NOTHING = 1e-12  # keeps the factor of a covariance that holds zeros defined


class _Ways(NamedTuple):
    """paths: (n, parts so far + 1, width) nodes. shares: (n,) of all that is believed."""

    paths: np.ndarray
    shares: np.ndarray


def searched_nodes(
    log: RunLog, odometry: OdometryModel, state: State, covariance: np.ndarray, matching: SurfaceMatching
) -> np.ndarray:
    """Return the nodes (parts, width) of the newest turn, moved to where its parts fit what was heard before them.

    covariance: (width, width) of the node before them. Where the motion is known well they stay as they are. Equal
    runs draw equal ways.
    """
    count = matching.scan_parts
    first = log.scan_count - count
    newest, before = state.nodes[first:], log.rows(max(0, first - COMPARED_SCANS * count), first)
    if not len(before) or is_known(step_covariance(log, odometry, state, covariance, count), matching):
        return newest[1:]
    heard = _Heard(log, odometry, state, matching, place(log, odometry, state, before))
    rng = np.random.RandomState(first)
    starts = newest[0] + _drawn(rng, _known_pose(covariance))
    ways = _Ways(starts[:, np.newaxis], np.full(_WAYS, 1.0 / _WAYS))
    for scan in range(first, log.scan_count):
        ways = _continued(_resampled(ways, rng), heard, scan, rng)
    return _most_believed(ways)[1:]


class _Heard(NamedTuple):
    """What ways are compared with. targets: points of earlier scans."""

    log: RunLog
    odometry: OdometryModel
    state: State
    matching: SurfaceMatching
    targets: PlacedPoints


def _continued(ways: _Ways, heard: _Heard, scan: int, rng: np.random.RandomState) -> _Ways:
    """Return `ways` with the node after `scan`, and what is believed of each."""
    nodes = heard.state.nodes[scan : scan + 2]
    motion = heard.log.node_motion(np.array([scan, scan + 1]))
    expected = heard.odometry.advanced(ways.paths[:, -1], motion[:1], motion[1:])
    noise = Transition.of(heard.odometry, nodes, motion).noise
    ends = expected + _drawn(rng, noise)
    moves = ways.paths[:, -1, :2] - nodes[0, :2], ends[:, :2] - nodes[1, :2]
    nats = _nats(heard, scan, *moves)
    shares = ways.shares * np.exp(nats - nats.max())
    return _Ways(np.concatenate([ways.paths, ends[:, np.newaxis]], axis=1), shares / shares.sum())


def _nats(heard: _Heard, scan: int, first: np.ndarray, last: np.ndarray) -> np.ndarray:
    """Return how much (n,) a scan speaks for its nodes being moved by `first` and `last`, (n, 2) m each."""
    rows = heard.log.rows(scan, scan + 1)
    if not len(rows):
        return np.zeros(len(first))
    step = max(1, len(rows) // _MOST_POINTS)
    sources = place(heard.log, heard.odometry, heard.state, rows[::step])
    share = sources.shares[:, np.newaxis]
    moved = sources.places + (1.0 - share) * first[:, np.newaxis] + share * last[:, np.newaxis]
    distance, index = cKDTree(heard.targets.places).query(moved.reshape(-1, 2), distance_upper_bound=_REACH)
    found = np.isfinite(distance)
    index = np.where(found, index, 0).reshape(moved.shape[:2])
    facing = np.einsum("na,kna->kn", sources.normals, heard.targets.normals[index]) > heard.matching.min_cosine
    near = np.exp(-0.5 * np.where(found, distance / _NEAR, np.inf) ** 2).reshape(facing.shape)
    return _NATS * step * (near * facing) @ sources.qualities


def _resampled(ways: _Ways, rng: np.random.RandomState) -> _Ways:
    """Return as many ways, each as often as it is believed."""
    count = len(ways.shares)
    chosen = np.searchsorted(np.cumsum(ways.shares), (rng.rand() + np.arange(count)) / count)
    return _Ways(ways.paths[np.minimum(chosen, count - 1)], np.full(count, 1.0 / count))


def _most_believed(ways: _Ways) -> np.ndarray:
    """Return the mean (parts + 1, width) of the ways that end about where most is believed."""
    ends = ways.paths[:, -1, :2]
    groups = cKDTree(ends).query_ball_point(ends, _ALIKE)
    best = groups[int(np.argmax([ways.shares[group].sum() for group in groups]))]
    return np.einsum("n,nkw->kw", ways.shares[best], ways.paths[best]) / ways.shares[best].sum()


def _known_pose(covariance: np.ndarray) -> np.ndarray:
    """Return a node's covariance as seen from its own pose."""
    known = covariance.copy()
    known[POSE] = known[:, POSE] = 0.0
    return known


def _drawn(rng: np.random.RandomState, covariance: np.ndarray) -> np.ndarray:
    """Return errors (n, width) of a covariance (width, width)."""
    factor = np.linalg.cholesky(covariance + _NOTHING * np.eye(len(covariance)))
    return rng.normal(size=(_WAYS, len(covariance))) @ factor.T
