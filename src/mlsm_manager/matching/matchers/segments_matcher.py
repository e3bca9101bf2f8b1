"""The thesis's own matcher, kept as the yardstick (6.3, 6.5.6).

Of the 2015 code only evident slips are mended: a block's height was compared with the mean of its x, stamps fell out of
step with points, and the branch for a vehicle at rest never translated. As there, only translations are found: the yaw
stays the prior's.
"""

import time

import numpy as np

from mlsm_manager.matching.matchers.parameters import SegmentsMatcherParameters
from mlsm_manager.scan_matching.result import MatchResult, MatchStatus, Prior
from mlsm_manager.scan_matching.scan import Scan
from mlsm_manager.surface_map.blocks import Blocks, BlockSource, all_of
from mlsm_manager.thesis_matching.registration import ClosestBlocks, SegmentFit, translate_segments
from node_support.geometry import composed, transformed, wrapped

# The same as a line through times needs.
_FEWEST_POINTS = 3


class SegmentsMatcher:
    """Iterates closest blocks and translations by segments until the error is small."""

    def __init__(self, parameters: SegmentsMatcherParameters) -> None:
        self.parameters = parameters

    def match(self, scan: Scan, target: BlockSource, prior: Prior) -> MatchResult:
        """Return where the scan was taken; see Matcher."""
        start = time.perf_counter()
        target = all_of(target)
        order = np.argsort(scan.times, kind="stable")
        times, moving = scan.times[order], scan.moving[order]
        if len(scan) < _FEWEST_POINTS or not len(target):
            shifts = np.zeros((len(scan), 2))
            fit = SegmentFit(shifts, np.zeros(2))
            return self._result(MatchStatus.TOO_FEW_POINTS, scan, prior, times, fit, np.inf, 0, start)
        closest = ClosestBlocks(target)
        points = transformed(prior.correction, scan.points[order])
        placed, shifts = points.copy(), np.zeros((len(scan), 2))
        steps = self._steps(scan, prior, times, moving)
        error, iterations, slope = np.inf, 0, np.zeros(2)
        while iterations < self.parameters.max_iterations and error > self.parameters.error_threshold:
            found = closest.find_along(placed[:, :3], steps, self.parameters.n_samples)
            fit = translate_segments(times, moving, target.mean[found, :2] - placed[:, :2])
            shifts, slope = shifts + fit.translations, slope + fit.slope
            placed[:, :2] = points[:, :2] + shifts
            error = _error(placed, target, found)
            iterations += 1
        holds = error <= self.parameters.error_threshold
        status = MatchStatus.CONVERGED if holds else MatchStatus.DIVERGED
        return self._result(status, scan, prior, times, SegmentFit(shifts, slope), error, iterations, start)

    def _steps(self, scan: Scan, prior: Prior, times: np.ndarray, moving: np.ndarray) -> np.ndarray:
        """Return (n, 3) one sample's step of each point: moving time times velocity times sample_step, in map."""
        first, last = scan.track.at(np.array([times[0], scan.reference_time]))
        velocity = (last - first)[:2] / max(scan.reference_time - times[0], 1e-9)
        velocity = transformed(np.array([0.0, 0.0, prior.correction[2]]), velocity[np.newaxis])[0]
        seconds = np.cumsum(np.where(moving, np.diff(times, prepend=times[0]), 0.0))
        steps = np.zeros((len(times), 3))
        steps[:, :2] = seconds[:, np.newaxis] * velocity * self.parameters.sample_step
        return np.where(moving[:, np.newaxis], steps, 0.0)

    def _result(
        self,
        status: MatchStatus,
        scan: Scan,
        prior: Prior,
        times: np.ndarray,
        fit: SegmentFit,
        error: float,
        iterations: int,
        start: float,
    ) -> MatchResult:
        beam_times, last_of_beam = _last_of_each(np.append(times, scan.reference_time))
        shifts = np.vstack([fit.translations, fit.translations[-1:] if len(times) else np.zeros((1, 2))])[last_of_beam]
        beam_poses = composed(prior.correction, scan.track.at(beam_times))
        beam_poses[:, :2] += shifts
        pose = beam_poses[-1].copy()
        pose[2] = wrapped(pose[2])
        slope = transformed(np.array([0.0, 0.0, -pose[2]]), fit.slope[np.newaxis])[0]
        state = prior.covariance.copy()
        if status is MatchStatus.CONVERGED:
            # The thesis knows no covariance: a block's cell says no more of a point than half its own side.
            state[:2, :] = state[:, :2] = 0.0
            state[:2, :2] = np.eye(2) * max(error, 1e-3) ** 2
        reason = "" if status is MatchStatus.CONVERGED else f"error {error:.3f} m after {iterations} iterations"
        rate = prior.rate + np.append(slope, 0.0)
        return MatchResult(
            status, pose, scan.track.velocity_at(scan.reference_time) + rate, state[:6, :6], rate, prior.motion, state,
            float(error), len(scan), iterations, time.perf_counter() - start, beam_times, beam_poses, reason,
        )  # fmt: skip


def _error(points: np.ndarray, target: Blocks, found: np.ndarray) -> float:
    """Return the mean distance from points to their blocks, zero for those inside a block's spread (thesis 6.5.6)."""
    distance = np.linalg.norm(points[:, :2] - target.mean[found, :2], axis=1)
    spread = np.sqrt(target.variance[found, :2].sum(axis=1))
    return float(np.where(distance <= spread, 0.0, distance).mean())


def _last_of_each(times: np.ndarray) -> tuple:
    last = np.flatnonzero(np.append(times[1:] != times[:-1], True))
    return times[last], last
