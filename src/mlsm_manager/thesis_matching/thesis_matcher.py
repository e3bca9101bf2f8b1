"""The thesis's matcher (6.3, 6.5.6): iterated closest blocks, with a rotation for still scans and segments for others.

Of the 2015 code only evident slips are mended: a block's height was compared with the mean of its x, stamps fell out of
step with points, the branch for a vehicle at rest never translated, and the first pose whose error was below the
threshold was taken, however much better the next one was. What the thesis leaves open: echoes that the map does not
have do not count (see belonging).
"""

import time
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from mlsm_manager.scan_matching.scan import MatchResult, MatchStatus, Prior, Scan
from mlsm_manager.scan_matching.scan_path import POSE, POSITION
from mlsm_manager.surface_map.blocks import Blocks, BlockSource, all_of
from mlsm_manager.thesis_matching.registration import ClosestBlocks, belonging, rigid_motion, translate_segments
from node_support.geometry import composed, rotated, transformed, wrapped
from node_support.parameters import ParameterSet, parameter

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

    def match(self, scan: Scan, target: BlockSource, prior: Prior) -> MatchResult:
        """Return where the scan was taken; see Matcher."""
        start = time.perf_counter()
        blocks, order = all_of(target), np.argsort(scan.times, kind="stable")
        scan = replace(scan, points=scan.points[order], times=scan.times[order], moving=scan.moving[order])
        if len(scan) < _FEWEST_POINTS or not len(blocks):
            fit = _Fit(prior.correction, np.zeros((len(scan), 2)), np.zeros(2), np.inf, 0)
            return _result(MatchStatus.TOO_FEW_POINTS, scan, prior, fit, start)
        fit = self._registered(scan, blocks, prior)
        holds = fit.error <= self.parameters.error_threshold
        return _result(MatchStatus.CONVERGED if holds else MatchStatus.DIVERGED, scan, prior, fit, start)

    def _registered(self, scan: Scan, blocks: Blocks, prior: Prior) -> _Fit:
        closest, steps = ClosestBlocks(blocks), self._steps(scan, prior)
        fit = _Fit(prior.correction, np.zeros((len(scan), 2)), np.zeros(2), np.inf, 0)
        while fit.iterations < self.parameters.max_iterations:
            places = fit.placed(scan.points)
            found = closest.find_along(places, steps, self.parameters.n_samples)
            counted = belonging(places[:, :2], blocks.mean[found, :2], blocks.resolution)
            moved = _moved(fit, scan, places[:, :2], blocks.mean[found, :2], counted)
            there = moved.placed(scan.points)
            moved = moved._replace(error=_error(there[counted, :2], blocks.take(found[counted])))
            # The search along the movement pulls on for ever: a moving scan ends where its error is least.
            if scan.moving.any() and moved.error > fit.error:
                return fit._replace(iterations=moved.iterations)
            fit = moved
            if np.linalg.norm(there - places, axis=1).mean() < _SHORTEST:
                break
        return fit

    def _steps(self, scan: Scan, prior: Prior) -> np.ndarray:
        """Return (n, 3) one sample's step of each point: moving time times velocity times sample_step, in map."""
        first, last = scan.track.at(np.array([scan.times[0], scan.reference_time]))
        velocity = (last - first)[:2] / max(scan.reference_time - scan.times[0], 1e-9)
        velocity = rotated(velocity, prior.correction[2])
        seconds = np.cumsum(np.where(scan.moving, np.diff(scan.times, prepend=scan.times[0]), 0.0))
        steps = np.zeros((len(scan), 3))
        steps[:, :2] = seconds[:, np.newaxis] * velocity * self.parameters.sample_step
        return np.where(scan.moving[:, np.newaxis], steps, 0.0)


def _moved(fit: _Fit, scan: Scan, places: np.ndarray, targets: np.ndarray, counted: np.ndarray) -> _Fit:
    """Return the fit after one iteration, which moves points at `places` (n, 2) to `targets` (n, 2), their blocks."""
    if not scan.moving.any():
        correction = composed(rigid_motion(places[counted], targets[counted]), fit.correction)
        return fit._replace(correction=correction, iterations=fit.iterations + 1)
    found = translate_segments(scan.times, scan.moving, targets - places, counted)
    shifts, slope = fit.shifts + found.translations, fit.slope + found.slope
    return fit._replace(shifts=shifts, slope=slope, iterations=fit.iterations + 1)


def _error(places: np.ndarray, blocks: Blocks) -> float:
    """Return the mean distance from places to their blocks, zero for those inside a block's spread (thesis 6.5.6)."""
    distance = np.linalg.norm(places - blocks.mean[:, :2], axis=1)
    spread = np.sqrt(blocks.variance[:, :2].sum(axis=1))
    return float(np.where(distance <= spread, 0.0, distance).mean())


def _result(status: MatchStatus, scan: Scan, prior: Prior, fit: _Fit, start: float) -> MatchResult:
    """Return the result of a match that began at `start` [s]."""
    beam_times, first_of_beam = np.unique(np.append(scan.times, scan.reference_time), return_index=True)
    beam_poses = composed(fit.correction, scan.track.at(beam_times))
    beam_poses[:, :2] += np.vstack([fit.shifts, fit.shifts[-1:] if len(scan) else np.zeros((1, 2))])[first_of_beam]
    pose = beam_poses[-1].copy()
    pose[2] = wrapped(pose[2])
    missed = np.append(rotated(fit.slope, -pose[2]), 0.0)
    state, accepted = prior.covariance.copy(), status is MatchStatus.CONVERGED
    if accepted:
        _take_error(state, scan, fit.error)
    return MatchResult(
        status=status, pose=pose, velocity=scan.track.velocity_at(scan.reference_time) + prior.rate + missed,
        covariance=state[:6, :6], rate=prior.rate, motion=prior.motion, state_covariance=state, error=float(fit.error),
        points_used=len(scan), seconds=time.perf_counter() - start, beam_times=beam_times,
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
