"""The thesis's matcher (6.3, 6.5.6): iterated closest blocks, with a rotation for still scans and segments for others.

Of the 2015 code only evident slips are mended: a block's height was compared with the mean of its x, stamps fell out of
step with points, the branch for a vehicle at rest never translated, and the first pose whose error was below the
threshold was taken, however much better the next one was. What the thesis leaves open: echoes that the map does not
have do not count (see belonging). While the vehicle is still the error of all points is that of one pose; while it
moves it grows along a line over time, whose slope is the velocity that is missing (figures 6.6 to 6.8).
"""

import time
from dataclasses import dataclass, replace
from typing import NamedTuple, Optional, Tuple

import numpy as np
from scipy.spatial import cKDTree

from mlsm_manager.scan_matching.scan import Belief, MatchResult, MatchStatus, Scan
from mlsm_manager.scan_matching.scan_path import ERRORS, POSE, POSITION, RATE, YAW
from mlsm_manager.surface_map.blocks import Blocks, BlockSource, all_of
from node_support.geometry import composed, members, move_of, rotated, transformed, wrapped
from node_support.parameters import ParameterSet, parameter

_MEDIANS = 3.0  # of normal errors across a wall 4 % are farther
_FEWEST_TIMES = 3  # two times always lie on a line, and show no error of it


class ClosestBlocks:
    """Finds blocks through the tree of their cells; `blocks` must hold at least one."""

    def __init__(self, blocks: Blocks) -> None:
        self._blocks = blocks
        cells, cell_of_block, sizes = np.unique(blocks.cells, axis=0, return_inverse=True, return_counts=True)
        self._tree = cKDTree((cells + 0.5) * blocks.resolution)
        # The blocks of each cell, -1 where it has fewer than others.
        self._members = np.full((len(cells), int(sizes.max())), -1, dtype=np.int64)
        self._members[members(sizes)] = np.argsort(cell_of_block.reshape(-1), kind="stable")

    def find(self, points: np.ndarray) -> np.ndarray:
        """Return (...) indices of the blocks closest to points (..., 3): of the nearest cell, the nearest in height."""
        _, cell = self._tree.query(points[..., :2])
        members = self._members[cell]
        z = points[..., 2, np.newaxis]
        gap = np.maximum(self._blocks.bottom[members] - z, z - self._blocks.height[members])
        gap = np.where(members >= 0, np.maximum(gap, 0.0), np.inf)
        best = gap.argmin(axis=-1)
        return np.take_along_axis(members, best[..., np.newaxis], axis=-1)[..., 0]

    def find_along(self, points: np.ndarray, steps: np.ndarray, samples: int) -> np.ndarray:
        """Return (n,) indices for points (n, 3) that moved (figure 6.5).

        Of the blocks closest to the point and to `samples` places one step (n, 3) apart from there on, it is the one
        that lies best in the direction of the step. Points whose step is zero take their closest block.
        """
        closest = self.find(points)
        length = np.linalg.norm(steps, axis=1)
        moved = length > 0.0
        if samples == 0 or not moved.any():
            return closest
        start, step = points[moved], steps[moved]
        places = start[:, np.newaxis, :] + np.arange(samples)[:, np.newaxis] * step[:, np.newaxis, :]
        found = self.find(places)
        direction = self._blocks.mean[found, :3] - start[:, np.newaxis, :]
        distance = np.maximum(np.linalg.norm(direction, axis=-1), 1e-12)
        cosine = np.einsum("nja,na->nj", direction, step / length[moved][:, np.newaxis]) / distance
        closest[moved] = found[np.arange(len(found)), cosine.argmax(axis=1)]
        return closest


def belonging(places: np.ndarray, targets: np.ndarray, resolution: float) -> np.ndarray:
    """Return (n,) bool: which places (n, 2) and targets (n, 2) [m] are pairs, and no echo that the map does not have.

    The thesis pairs every point (6.5.6). Its noise echoes then pull still scans up to 0.2 m along walls, even from the
    true pose; so only pairs count that are within three medians (as by Zhang 1994), or within one cell, as points and
    their blocks are when a map is drawn (6.5.6).
    """
    distance = np.linalg.norm(targets - places, axis=1)
    return distance <= max(resolution, _MEDIANS * float(np.median(distance)))


def rigid_motion(points: np.ndarray, targets: np.ndarray) -> np.ndarray:
    """Return the motion (3,) x y yaw that takes points (n, 2) nearest to their targets (n, 2) (Besl and McKay 1992)."""
    middle, target = points.mean(axis=0), targets.mean(axis=0)
    arms, wanted = points - middle, targets - target
    cross = arms[:, 0] @ wanted[:, 1] - arms[:, 1] @ wanted[:, 0]
    yaw = np.arctan2(cross, (arms * wanted).sum())
    return np.append(target - rotated(middle, yaw), yaw)


def translate_segments(
    times: np.ndarray, moving: np.ndarray, errors: np.ndarray, counted: np.ndarray
) -> Tuple[np.ndarray, np.ndarray]:
    """Return the translations (n, 2) [m] that segments of points need, and slope (2,) [m/s] of the last, 0 if still.

    times: (n,) s, increasing or equal. moving: (n,) bool; a segment is a run of equal values. errors: (n, 2) m from
    each point to its block. counted: (n,) bool, whose errors count; a segment without any goes on as the one before.
    A still segment moves by its mean error (the centroids' difference); a moving one starts with the translation that
    the segment before it ended with and goes on along a line.
    """
    translations = np.zeros((len(times), 2))
    slope = np.zeros(2)
    last: Optional[np.ndarray] = None
    changes = np.flatnonzero(np.diff(moving)) + 1
    for first, end in zip([0, *changes], [*changes, len(moving)]):
        part, chosen = slice(first, end), counted[first:end]
        if not chosen.any():
            translations[part] = 0.0 if last is None else last
        elif not moving[first]:
            slope = np.zeros(2)
            translations[part] = errors[part][chosen].mean(axis=0)
        else:
            since = times[part] - (times[first - 1] if first else times[first])
            offset, slope = _line(since[chosen], errors[part][chosen], last)
            translations[part] = offset + since[:, np.newaxis] * slope
        last = translations[end - 1]
    return translations, slope


def _line(since: np.ndarray, errors: np.ndarray, start: Optional[np.ndarray]) -> Tuple[np.ndarray, np.ndarray]:
    """Return offset (2,) and slope (2,) by least squares; the line begins at `start` (2,) where that is known."""
    if np.unique(since).size < _FEWEST_TIMES:
        return errors.mean(axis=0), np.zeros(2)
    if start is not None:
        return start, since @ (errors - start) / (since @ since)
    centered = since - since.mean()
    slope = centered @ errors / (centered @ centered)
    return errors.mean(axis=0) - since.mean() * slope, slope


_FEWEST_POINTS = 3  # the same as a line through times needs
_LEAST_ERROR = 1e-3  # m: keeps the covariance of a scan that lies on its blocks from vanishing
_SHORTEST = 1e-3  # m: an iteration that moves the points by less, in the mean, is the last one


@dataclass(frozen=True)
class ThesisMatcherParameters(ParameterSet):
    """Parameters of the thesis's matcher."""

    max_iterations: int = parameter(
        200, "THESIS: iterations at most", low=1, high=1000, thesis_name="maxIterations",
        expert="still scans need 40 to 150; others end earlier",
    )  # fmt: skip
    error_threshold: float = parameter(
        0.3, "THESIS: greatest error of a match that is accepted", unit="m", low=0.0, high=100.0,
        expert="errorThreshold of the thesis, section 6.5.6, which only ended the iterations",
    )  # fmt: skip
    n_samples: int = parameter(
        5, "THESIS: places searched in the direction of movement", low=0, high=100, thesis_name="nSamples",
        expert="as in the thesis, section 6.5.6",
    )  # fmt: skip
    sample_step: float = parameter(
        0.1, "THESIS: distance of these places, as a share of the estimated movement", low=0.0, high=10.0,
        thesis_name="sampleStep", expert="as in the thesis, section 6.5.6",
    )  # fmt: skip


class _Fit(NamedTuple):
    """correction: (3,) T_map_odom. shifts: (n, 2) m in map of the points besides. slope: (2,) m/s in map, at the end.

    error: m. iterations: so many led here.
    """

    correction: np.ndarray
    shifts: np.ndarray
    slope: np.ndarray
    error: float
    iterations: int

    def placed(self, points: np.ndarray) -> np.ndarray:
        """Return points (n, 3) in map for points (n, 4) in odom."""
        places = transformed(self.correction, points)[:, :3]
        places[:, :2] += self.shifts
        return places


class ThesisMatcher:
    """Moves a scan onto the closest blocks until its error no longer falls."""

    def __init__(self, parameters: ThesisMatcherParameters) -> None:
        self.parameters = parameters

    def match(self, scan: Scan, target: BlockSource, belief: Belief) -> MatchResult:
        start = time.perf_counter()
        blocks, order = all_of(target), np.argsort(scan.times, kind="stable")
        scan = replace(scan, points=scan.points[order], times=scan.times[order], moving=scan.moving[order])
        correction = move_of(scan.reference_pose, belief.theta[POSE])
        fit = _Fit(correction, np.zeros((len(scan), 2)), np.zeros(2), np.inf, 0)
        if len(scan) < _FEWEST_POINTS or not len(blocks):
            return _result(MatchStatus.TOO_FEW_POINTS, scan, belief, fit, start)
        fit = self._registered(scan, blocks, fit)
        holds = fit.error <= self.parameters.error_threshold
        return _result(MatchStatus.CONVERGED if holds else MatchStatus.DIVERGED, scan, belief, fit, start)

    def _registered(self, scan: Scan, blocks: Blocks, fit: _Fit) -> _Fit:
        closest, steps = ClosestBlocks(blocks), self._steps(scan, fit.correction)
        while fit.iterations < self.parameters.max_iterations:
            places = fit.placed(scan.points)
            found = closest.find_along(places, steps, self.parameters.n_samples)
            counted = belonging(places[:, :2], blocks.mean[found, :2], blocks.resolution)
            moved = _moved(fit, scan, places[:, :2], blocks.mean[found, :2], counted)
            there = moved.placed(scan.points)
            # The mean distance from places to their blocks, zero for those inside a block's spread (thesis 6.5.6).
            distance = np.linalg.norm(there[counted, :2] - blocks.mean[found[counted], :2], axis=1)
            spread = np.sqrt(blocks.variance[found[counted], :2].sum(axis=1))
            moved = moved._replace(error=float(np.where(distance <= spread, 0.0, distance).mean()))
            # The search along the movement pulls on for ever: a moving scan ends where its error is least.
            if scan.moving.any() and moved.error > fit.error:
                return fit._replace(iterations=moved.iterations)
            fit = moved
            if np.linalg.norm(there - places, axis=1).mean() < _SHORTEST:
                break
        return fit

    def _steps(self, scan: Scan, correction: np.ndarray) -> np.ndarray:
        """Return (n, 3) one sample's step of each point: moving time times velocity times sample_step, in map."""
        first, last = scan.track.at(np.array([scan.times[0], scan.reference_time]))
        velocity = (last - first)[:2] / max(scan.reference_time - scan.times[0], 1e-9)
        velocity = rotated(velocity, correction[2])
        seconds = np.cumsum(np.where(scan.moving, np.diff(scan.times, prepend=scan.times[0]), 0.0))
        steps = np.zeros((len(scan), 3))
        steps[:, :2] = seconds[:, np.newaxis] * velocity * self.parameters.sample_step
        return np.where(scan.moving[:, np.newaxis], steps, 0.0)


def _moved(fit: _Fit, scan: Scan, places: np.ndarray, targets: np.ndarray, counted: np.ndarray) -> _Fit:
    """Return the fit after one iteration, which moves points at `places` (n, 2) to `targets` (n, 2), their blocks."""
    if not scan.moving.any():
        correction = composed(rigid_motion(places[counted], targets[counted]), fit.correction)
        return fit._replace(correction=correction, iterations=fit.iterations + 1)
    shifts, slope = translate_segments(scan.times, scan.moving, targets - places, counted)
    return fit._replace(shifts=fit.shifts + shifts, slope=fit.slope + slope, iterations=fit.iterations + 1)


def _result(status: MatchStatus, scan: Scan, belief: Belief, fit: _Fit, start: float) -> MatchResult:
    """Return the result of a match that began at `start` [s]."""
    beam_times, first_of_beam = np.unique(np.append(scan.times, scan.reference_time), return_index=True)
    beam_poses = composed(fit.correction, scan.track.at(beam_times))
    beam_poses[:, :2] += np.vstack([fit.shifts, fit.shifts[-1:] if len(scan) else np.zeros((1, 2))])[first_of_beam]
    theta = np.append(beam_poses[-1], belief.theta[ERRORS])
    theta[YAW] = wrapped(theta[YAW])
    missed = np.append(rotated(fit.slope, -theta[YAW]), 0.0)
    state, accepted = belief.covariance.copy(), status is MatchStatus.CONVERGED
    if accepted:
        _take_error(state, scan, fit.error)
    return MatchResult(
        status=status, belief=Belief(scan.reference_time, theta, state),
        velocity=scan.track.velocity_at(scan.reference_time) + theta[RATE] + missed, covariance=state[:6, :6],
        error=float(fit.error), points_used=len(scan), seconds=time.perf_counter() - start, beam_times=beam_times,
        beam_poses=beam_poses, reason="" if accepted else f"error {fit.error:.3f} m after {fit.iterations} iterations",
    )  # fmt: skip


def _take_error(state: np.ndarray, scan: Scan, error: float) -> None:
    """Write into the covariance (8, 8) what a fit with `error` [m] tells: the thesis knows no covariance.

    The heading of a still scan is taken as certain as its farthest echo shows it; that of a moving one stays.
    """
    found = POSITION if scan.moving.any() else POSE
    state[found, :] = state[:, found] = 0.0
    deviation = max(error, _LEAST_ERROR)
    reach = float(np.hypot(*(scan.points[:, :2] - scan.reference_pose[:2]).T).max())
    state[POSE, POSE] += np.diag([deviation, deviation, 0.0 if scan.moving.any() else deviation / max(reach, 1.0)]) ** 2
