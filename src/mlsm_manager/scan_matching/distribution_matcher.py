"""Finds one scan in a map: a correlative search, then one path for the whole scan among local distributions."""

import time
from dataclasses import dataclass, replace
from typing import List, Tuple

import numpy as np

from mlsm_manager.scan_matching.correlative_search import YAW_STEP, ScoreField, SearchWindow, search, separation
from mlsm_manager.scan_matching.distributions import LocalDistributions
from mlsm_manager.scan_matching.gauss_newton import Fit, PriorState, Refiner
from mlsm_manager.scan_matching.judgement import agreement, lead_along, significance
from mlsm_manager.scan_matching.prediction import OdometryErrors
from mlsm_manager.scan_matching.scan import Belief, Matcher, MatchResult, MatchStatus, Scan
from mlsm_manager.scan_matching.scan_path import POSE, POSITION, RATE_YAW, STATES, YAW, PlanarMotion, X, Y
from mlsm_manager.surface_map.blocks import Blocks, BlockSource, all_of
from node_support.geometry import wrapped

_WINDOW_DEVIATIONS = 3.0  # of the prior, that the search covers
# Of a score from 0 to 1 per squared standard deviation of the prior: echoes that travel with the vehicle cannot win.
_PRIOR_COST_SHARE = 0.01
_MOST_RATES = 9  # errors of the yaw rate that are tried: the next one costs a ninth more time
_LEAST_VARIANCE = 1e-12  # keeps the covariance of a prior with fixed states invertible
_FIELD_CELLS = 2.0  # width of the field in search cells: a basin reaches over the nearest grid poses
_MARGIN = 15.0  # m: neighbours that make the distributions at the edge of the reach
_APART = 0.5  # of what keeps two candidates of the search apart
_EXCLUDED = 4.0  # standard deviations at which a covariance claims to exclude a place


@dataclass(frozen=True)
class MatcherLimits:
    """Where a scan is searched, and what a fix must hold to. Metres and radians.

    search_distance, search_angle: greatest difference from the expected pose. search_cell: step of the search.
    candidates: poses that it passes on to the refinement. max_steps: Gauss-Newton steps from each of them.
    min_points: of a scan, on the map. max_jump: of a fix from the expected pose, in the prior's standard deviations.
    max_position_deviation, max_yaw_deviation: of a fix, in its least certain direction.
    min_gain_over_second: lead in log-likelihood [nat] of the best pose over any other.
    min_significance: lead of the matched share of points over that of random poses, in standard deviations.
    min_explained: share of all echoes that lie on the map.
    min_agreement: share of echoes that the map explains times share of the map that no echo denies.
    same_place: poses nearer than this that fit nearly as well widen the covariance; farther ones refuse the fix.
    """

    # 3.5 m and 22 deg find 99 % of moves of 3 m and 20 deg, in 8 to 35 ms.
    search_distance: float = 3.5
    search_angle: float = 0.384
    search_cell: float = 0.5  # a cell of the map, from which the fit reaches the best place
    candidates: int = 6  # the pose with the best score is not always the best fit; each costs a fit
    max_steps: int = 40  # a fit that has not ended by then does not end
    min_points: int = 15  # fewer do not fix three coordinates against chance
    max_jump: float = 4.0  # noise alone jumps farther once in 16,000 fixes
    max_position_deviation: float = 0.5
    max_yaw_deviation: float = 0.1  # 6 deg: at 10 m a point is then a metre off
    min_gain_over_second: float = 3.0  # the best place is e^3, 20 times, as likely as the second-best
    min_significance: float = 5.0  # chance leads by so much once in millions of scans; in canals nothing else refuses
    min_explained: float = 0.0  # near the expected place part of a scan may be of unknown water
    min_agreement: float = 0.8  # a wrong place seldom explains so much; boats and tide explain less at the right one
    same_place: float = 0.0  # near the expected place the next scan decides


NEARBY = MatcherLimits()
# Up to 500 m away with any heading; a cell of 1 m keeps the search within seconds, and 80 candidates make up for it.
# A wrong place costs a lost vehicle more than none: it must be e^6 times as likely as the next. In a marina of which
# the sonar sends plateaus, poses up to 2.4 m beside the best one fit nearly as well; the next scans tell which it is.
# Of a scan 0.93 to 1.0 lie on the map where it was taken, there, in a basin and in a harbour; of one end of the basin
# 0.80 to 0.92 lie on the other end, which looks alike, where the map has only that. Two scans must be found, so that
# fewer of the map's blocks need be heard of each: in the harbour half of them are not.
EVERYWHERE = MatcherLimits(
    search_distance=500.0, search_angle=np.pi, search_cell=1.0, candidates=80, min_gain_over_second=6.0,
    min_explained=0.93, min_agreement=0.6, same_place=3.0,
)  # fmt: skip


class DistributionMatcher:
    """Searches around the prior, refines the best candidates and judges what comes out."""

    def __init__(self, limits: MatcherLimits, beam_width: float, range_scale_deviation: float) -> None:
        """beam_width: horizontal, rad. range_scale_deviation: of a common relative error of all ranges."""
        self.limits, self.beam_width, self.range_scale_deviation = limits, beam_width, range_scale_deviation

    def match(self, scan: Scan, target: BlockSource, belief: Belief) -> MatchResult:
        start = time.perf_counter()
        # States without variance are fixed.
        state = PriorState(belief.theta, np.linalg.inv(belief.covariance + _LEAST_VARIANCE * np.eye(STATES)))
        motion = PlanarMotion(scan, self.beam_width / np.sqrt(12.0))
        fewest = self.limits.min_points
        window = self._window(motion, state)
        blocks = _in_reach(target, motion, state, window)
        if len(scan) < fewest or len(blocks) < fewest:
            reason = f"{len(scan)} points and {len(blocks)} blocks in reach, must be {fewest} or more"
            nothing, covariance = np.empty(0), np.linalg.inv(state.information)
            fit = Fit(state.mean, covariance, 0.0, 1.0, 0.0, nothing.astype(bool), nothing, 0, converged=False)
            return _result(MatchStatus.TOO_FEW_POINTS, reason, motion, fit, start)
        fits, refiner = self._fits(motion, blocks, state, window)
        best = fits[0]
        status, reason = self._judge(best, refiner, state, blocks)
        if status is MatchStatus.CONVERGED:
            best = replace(best, covariance=refiner.residual_covariance(best))
            status, reason = self._judge_second_places(best, fits[1:], refiner)
            best = self._covering(best, fits[1:])
        return _result(status, reason, motion, best, start)

    def _fits(
        self, motion: PlanarMotion, target: Blocks, state: PriorState, window: SearchWindow
    ) -> Tuple[List[Fit], Refiner]:
        limits = self.limits
        margin = window.distance + 2.0 * limits.search_cell
        field = ScoreField.of_blocks(target, limits.search_cell, _FIELD_CELLS * limits.search_cell, margin)
        pose_information = np.linalg.inv(np.linalg.inv(state.information)[POSE, POSE])
        penalty = _PRIOR_COST_SHARE * pose_information
        starts = search(motion, field, state.mean, window, penalty, limits.candidates)
        refiner = Refiner(motion, LocalDistributions(target), state, self.range_scale_deviation)
        fits = [refiner.refine(start, limits.max_steps) for start in starts]
        inflation = max(fits, key=lambda fit: fit.log_likelihood_gain).inflation
        return sorted(fits, key=lambda fit: (not fit.converged, -fit.gain(inflation))), refiner

    def _window(self, motion: PlanarMotion, state: PriorState) -> SearchWindow:
        deviations = _WINDOW_DEVIATIONS * np.sqrt(np.diag(np.linalg.inv(state.information)))
        seconds = max(motion.beam_times[-1] - motion.beam_times[0], 1e-3)
        step = 2.0 * YAW_STEP / seconds
        rates = min(int(np.ceil(deviations[RATE_YAW] / step - 0.5)), _MOST_RATES // 2)
        return SearchWindow(
            distance=min(float(deviations[POSITION].max()), self.limits.search_distance),
            angle=min(float(deviations[YAW]), self.limits.search_angle),
            yaw_rates=np.arange(-rates, rates + 1) * step,
        )

    def _judge(self, best: Fit, refiner: Refiner, state: PriorState, target: Blocks) -> Tuple[MatchStatus, str]:
        limits = self.limits
        if not best.converged:
            return MatchStatus.DIVERGED, f"not converged after {best.iterations} iterations"
        used = int(np.count_nonzero(best.inliers))
        if used < limits.min_points:
            return MatchStatus.TOO_FEW_POINTS, f"{used} points on the map, must be {limits.min_points} or more"
        certainty = significance(lambda moves: refiner.points.matched_shares(best.theta, moves))
        if certainty < limits.min_significance:
            return MatchStatus.DIVERGED, f"{certainty:.1f} standard deviations better than chance"
        jump = float(np.sqrt(2.0 * state.prior_cost(best.theta)))
        if jump > limits.max_jump:
            return MatchStatus.REJECTED_JUMP, f"{jump:.1f} standard deviations from where it was expected"
        echoes = refiner.points.world(best.theta)
        explained, agreed = agreement(echoes, best.inliers, best.theta[POSITION], target.mean[:, :2])
        if explained < limits.min_explained:
            return MatchStatus.DIVERGED, f"only {explained:.2f} of the echoes lie on the map: perhaps another place"
        if agreed < limits.min_agreement:
            return MatchStatus.DIVERGED, f"scan and map agree by only {agreed:.2f}: perhaps another place"
        position = float(np.sqrt(np.linalg.eigvalsh(best.covariance[POSITION, POSITION])[-1]))
        if position > limits.max_position_deviation:
            return MatchStatus.AMBIGUOUS, f"standard deviation of {position:.2f} m in the least certain direction"
        yaw = float(np.sqrt(best.covariance[YAW, YAW]))
        if yaw > limits.max_yaw_deviation:
            return MatchStatus.AMBIGUOUS, f"heading has a standard deviation of {yaw:.3f} rad"
        return MatchStatus.CONVERGED, ""

    def _judge_second_places(self, best: Fit, others: List[Fit], refiner: Refiner) -> Tuple[MatchStatus, str]:
        """Reject a fix whose covariance excludes a pose of another place that fits nearly as well."""
        least = self.limits.min_gain_over_second
        for other in others:
            lead = best.gain(best.inflation) - other.gain(best.inflation)
            is_apart = separation(best.theta, other.theta) >= _APART and not self._is_same_place(best, other)
            if lead < least and is_apart and _excluded(best, other.theta):
                reason = f"another pose fits nearly as well: its log-likelihood is only {lead:.1f} less"
                return MatchStatus.AMBIGUOUS, reason
        values, vectors = np.linalg.eigh(best.covariance[POSITION, POSITION])
        excluded = max(_EXCLUDED * float(np.sqrt(values[-1])), self.limits.same_place)
        lead = lead_along(lambda moves: refiner.gains(best, moves), vectors[:, -1], excluded)
        if lead < least:
            reason = f"a pose beside it fits nearly as well: its log-likelihood is only {lead:.1f} less"
            return MatchStatus.AMBIGUOUS, reason
        return MatchStatus.CONVERGED, ""

    def _is_same_place(self, best: Fit, other: Fit) -> bool:
        x, y, yaw = (other.theta - best.theta)[POSE]
        return bool(np.hypot(x, y) < self.limits.same_place and abs(wrapped(yaw)) < self.limits.max_yaw_deviation)

    def _covering(self, best: Fit, others: List[Fit]) -> Fit:
        """Return a fit as unsure as the farthest pose of the same place that fits nearly as well is away."""
        most = best.gain(best.inflation) - self.limits.min_gain_over_second
        near = [one for one in others if self._is_same_place(best, one) and one.gain(best.inflation) > most]
        if not near:
            return best
        differences = np.array([one.theta - best.theta for one in near])
        differences[:, YAW] = wrapped(differences[:, YAW])
        farthest = differences[np.argmax(np.hypot(differences[:, X], differences[:, Y]))]
        return replace(best, covariance=best.covariance + np.outer(farthest, farthest))


def relocalised(scan: Scan, target: BlockSource, matcher: Matcher, errors: OdometryErrors) -> MatchResult:
    """Return where in the whole map `scan` was taken, whatever was believed before."""
    target = all_of(target)
    centers = target.mean[:, :2] if len(target) else np.zeros((1, 2))
    low, high = centers.min(axis=0), centers.max(axis=0)
    middle = np.concatenate([(low + high) / 2.0, scan.reference_pose[2:], np.zeros(STATES - 3)])
    covariance = errors.covariance()
    covariance[X, X] = covariance[Y, Y] = (float((high - low).max()) / 4.0 + 1.0) ** 2
    covariance[YAW, YAW] = np.pi**2
    return matcher.match(scan, target, Belief(scan.reference_time, middle, covariance))


def _in_reach(target: BlockSource, motion: PlanarMotion, state: PriorState, window: SearchWindow) -> Blocks:
    """Return the blocks within reach of the scan, so that the time of a match does not grow with the map."""
    offsets = motion.points(motion.path(state.mean)) - state.mean[POSITION]
    reach = float(np.linalg.norm(offsets, axis=1).max(initial=0.0)) + window.distance + _MARGIN
    blocks = target.in_box(state.mean[POSITION] - reach, state.mean[POSITION] + reach)
    return blocks.take(np.linalg.norm(blocks.mean[:, :2] - state.mean[POSITION], axis=1) < reach)


def _excluded(fit: Fit, theta: np.ndarray) -> bool:
    difference = (theta - fit.theta)[POSE]
    difference[YAW] = wrapped(difference[YAW])
    return bool(difference @ np.linalg.solve(fit.covariance[POSE, POSE], difference) > _EXCLUDED**2)


def _result(status: MatchStatus, reason: str, motion: PlanarMotion, fit: Fit, start: float) -> MatchResult:
    used = fit.distances[fit.inliers]
    to_output = np.zeros((6, STATES))
    to_output[POSE, POSE] = np.eye(3)
    to_output[3:] = motion.velocity_jacobian(fit.theta)
    return MatchResult(
        status=status,
        belief=Belief(float(motion.beam_times[-1]), fit.theta, fit.covariance),
        velocity=motion.velocity(fit.theta),
        covariance=to_output @ fit.covariance @ to_output.T,
        error=float(used.mean()) if used.size else float("inf"),
        points_used=int(used.size),
        seconds=time.perf_counter() - start,
        beam_times=motion.beam_times,
        beam_poses=motion.path(fit.theta),
        reason=reason,
    )
