"""Fits a whole run from several paths that the vehicle may have gone, and keeps the likeliest fit.

From each path it climbs to ones that the echoes support better, by shifting all that follows some moment. A batch fit
moves each scan to the nearest place where it fits, and a search that goes forward in time chooses before it has heard
all. Here a whole path is known, and each step weighs the whole run (basin hopping, Wales and Doye 1997).
"""

from dataclasses import dataclass, replace
from typing import Callable, Iterator, List, Sequence, Tuple

import numpy as np

from mlsm_manager.hovering.compiled_particles import Echoes
from mlsm_manager.hovering.particle_filter import ParticleFilter, on_path
from mlsm_manager.hovering.particles import echoes_of_run
from mlsm_manager.hovering.path_agreement import MissedPosts, log_likelihood, shift_gains
from mlsm_manager.joint_solver.batch_solver import BatchResult, fit_of, fit_path
from mlsm_manager.joint_solver.estimate import misfit_covariance
from mlsm_manager.joint_solver.live_solver import LiveSolver
from mlsm_manager.joint_solver.normal_equations import State
from mlsm_manager.joint_solver.run_log import RunLog
from mlsm_manager.joint_solver.solution import Solution

_REACH, _STEP = 40.0, 1.0  # m: shifts that are weighed; a post tells to about a metre
_ANY, _SMALL = (1.0, _REACH), (2.0, 7.0)  # m: far ones reach another place, small ones climb where far ones fit nothing
_WEIGHED_ANY, _WEIGHED_SMALL = 15, 25  # of which what is missed is weighed too
_FITTED = 6  # the best of these are fitted
_TURNS_OF_SHIFT = (1, 2)  # within which the vehicle goes as far as it is shifted
_ALIKE_SCANS, _ALIKE_SHIFT = 3, 2.5  # m: shifts that differ by less lead to the same fit
_KEPT = 4  # paths from which the search goes on
_OTHER = 0.7  # m in the mean from which on paths differ
_FASTEST = 1.2  # m/s: no vehicle of this kind goes faster
_ROUNDS = 12  # at most
_PATIENCE = 2  # rounds in which the best path hardly becomes better
_GAIN = 0.5  # of log likelihood that counts as better
_STRETCHES = np.linspace(-0.1, 0.1, 11)  # of the path; fits of basins agree about as well over a twentieth
_REFITS = 2  # the first undoes much of what a stretch does wrong

Refit = Callable[[np.ndarray], np.ndarray]
"""Takes a path (k, 2) through all nodes, returns the one near it on which the scans fit."""


@dataclass(frozen=True)
class JudgedPath:
    """path: (k, 2) m in map, through all nodes. log_likelihood: of the run's echoes on it."""

    path: np.ndarray
    log_likelihood: float


class ShiftSearch:
    """Shifts parts of paths to where the scans fit better."""

    def __init__(self, echoes: Echoes, times: np.ndarray, parts: int, refit: Refit) -> None:
        """echoes: of all scans, the nodes of which count from 0. times: (k,) s of the nodes. parts: scans per turn."""
        self.echoes, self.times, self.parts, self.refit = echoes, times, parts, refit
        self._missed = MissedPosts(echoes, parts)

    def judged(self, path: np.ndarray) -> JudgedPath:
        """Return a path (k, 2) with its log likelihood: of the echoes that agree, less what is missed."""
        return JudgedPath(path, log_likelihood(self.echoes, path) - self._missed.cost(path))

    def climbed(self, starts: Sequence[np.ndarray]) -> List[JudgedPath]:
        """Return the best paths that were found from `starts`, each (k, 2), the best first."""
        found = _distinct([self.judged(self.refit(path)) for path in starts])
        tried: List[JudgedPath] = []
        idle = 0
        for _ in range(_ROUNDS):
            new = [one for one in found if not any(_is_tried(one, old) for old in tried)]
            tried += new
            better = _distinct(found + [other for one in new for other in self._neighbours(one)])
            idle = 0 if better[0].log_likelihood > found[0].log_likelihood + _GAIN else idle + 1
            found = better
            if idle >= _PATIENCE:
                break
        return found

    def least_known_axis(self) -> np.ndarray:
        """Return the direction (2,) that the surfaces of the run tell least of."""
        weights = self.echoes.weights * ~self.echoes.post
        known = np.einsum("n,na,nb->ab", weights, self.echoes.normals, self.echoes.normals)
        return np.linalg.eigh(known)[1][:, 0]

    def _neighbours(self, start: JudgedPath) -> Iterator[JudgedPath]:
        """Yield the fits of the paths that the most promising shifts lead to."""
        for scan, shift in self._promising(start.path):
            for turns in _TURNS_OF_SHIFT:
                path = self._shifted(start.path, scan, shift, turns)
                if self._fastest(path) < max(_FASTEST, self._fastest(start.path)):
                    yield self.judged(self.refit(path))

    def _promising(self, path: np.ndarray) -> Iterator[tuple]:
        """Yield the scans and the shifts (2,) [m] that promise most."""
        axis = self.least_known_axis()
        lengths = np.arange(-_REACH, _REACH + _STEP / 2.0, _STEP)
        gains = shift_gains(self.echoes, path, axis, lengths)
        options = _chosen(gains, lengths, _ANY, _WEIGHED_ANY, [])
        options = _chosen(gains, lengths, _SMALL, _WEIGHED_SMALL, options)
        missed = [self._missed.cost(self._shifted(path, scan, lengths[n] * axis, 2)) for scan, n in options]
        promise = np.array([gains[option] for option in options]) - missed
        for number in np.argsort(-promise, kind="stable")[:_FITTED]:
            scan, length = options[number]
            yield scan, lengths[length] * axis

    def _shifted(self, path: np.ndarray, scan: int, shift: np.ndarray, turns: int) -> np.ndarray:
        """Return the path moved by `shift` (2,) [m] after `scan`, evenly within so many turns around its beginning."""
        within = turns * self.parts
        first = max(0, scan - within // 2)
        share = np.clip((np.arange(len(path)) - first) / within, 0.0, 1.0)
        return path + share[:, np.newaxis] * shift

    def _fastest(self, path: np.ndarray) -> float:
        """Return the greatest speed [m/s] over a turn."""
        parts = min(self.parts, len(path) - 1)
        return float((np.hypot(*(path[parts:] - path[:-parts]).T) / (self.times[parts:] - self.times[:-parts])).max())


def _chosen(gains: np.ndarray, lengths: np.ndarray, allowed: tuple, count: int, options: List[tuple]) -> List[tuple]:
    """Return `options` with `count` more: scan and row of `lengths` of the best gains (s, m) that differ from these."""
    sizes, wanted = np.abs(lengths), len(options) + count
    masked = np.where((sizes >= allowed[0]) & (sizes <= allowed[1]), gains, -np.inf)
    masked[0] = -np.inf

    def forget(scan: int, number: int) -> None:
        alike = np.abs(lengths - lengths[number]) < _ALIKE_SHIFT
        masked[max(0, scan - _ALIKE_SCANS) : scan + _ALIKE_SCANS + 1, alike] = -np.inf

    options = list(options)
    for option in options:
        forget(*option)
    while len(options) < wanted and np.isfinite(masked.max()):
        options.append(tuple(int(part) for part in np.unravel_index(np.argmax(masked), masked.shape)))
        forget(*options[-1])
    return options


def _distinct(paths: List[JudgedPath]) -> List[JudgedPath]:
    """Return the best of `paths`, a few, that differ from each other; the best first."""
    kept: List[JudgedPath] = []
    for one in sorted(paths, key=lambda path: -path.log_likelihood):
        if not any(_alike(one, other) for other in kept):
            kept.append(one)
        if len(kept) == _KEPT:
            break
    return kept


def _alike(one: JudgedPath, other: JudgedPath) -> bool:
    return float(np.hypot(*(one.path - other.path).T).mean()) < _OTHER


def _is_tried(one: JudgedPath, before: JudgedPath) -> bool:
    return _alike(one, before) and one.log_likelihood < before.log_likelihood + _GAIN


def stretched_mean(search: ShiftSearch, path: np.ndarray) -> JudgedPath:
    """Return the mean of the fits that begin at `path` (k, 2) [m] made longer and shorter, or `path` if it is better.

    Each fit counts as its echoes speak for it. A fit makes paths shorter, since echoes that lie closer together agree
    more often. The best fit is then at one end of those that agree about as well; the mean has the smaller error.
    """
    axis = search.least_known_axis()
    along = np.outer((path - path[0]) @ axis, axis)
    stretched = [path + stretch * along for stretch in _STRETCHES]
    for _ in range(_REFITS):
        stretched = [search.refit(one) for one in stretched]
    fits = [search.judged(one) for one in stretched]
    likelihoods = np.array([fit.log_likelihood for fit in fits])
    shares = np.exp(likelihoods - likelihoods.max())
    mean = np.einsum("n,nka->ka", shares / shares.sum(), np.array([fit.path for fit in fits]))
    return max(search.judged(path), search.judged(mean), key=lambda one: one.log_likelihood)


_FILTERS = 3  # besides the live one: one of three or four loses a simulated tour now and then
_ALL_TURNS = 200  # that particles reach back: all of a run of 50 minutes
_LIKELY = 20.0  # of log likelihood, by which a fit must be worse to count e times less, since neighbours share errors
_LONGEST_SHIFTED = 60  # turns, about 15 minutes: the time that shifts take grows with their square
_CLEARLY = 3.0  # of log likelihood, by which shifted paths must be better than the best fit before, or it is kept
# Times the likelihood: 1.01 on tours ahead, where the wider profile fits noise, and 1.04 where ranges changed besides;
# 1.25 and more on others, whatever changes of ranges are tried.
_STRAFES = 1.05


def solved_best(live: LiveSolver) -> BatchResult:
    """Return the fit of all scans that `live` has taken: from where it found them, and from paths found anew.

    Places that differ between fits that are about as likely are uncertain by as much.
    """
    starts = [live.state]
    for seed in range(1, _FILTERS + 1):
        found = ParticleFilter(seed=seed, remembered_turns=_ALL_TURNS).followed(live.log, live.parameters)
        starts.append(_on_path(live, found.particles.most_likely()))
    fits = [fit_of(live.solution.with_state(start)) for start in starts]
    search = _shift_search(live)
    judged = [search.judged(_path(live, fit.state)) for fit in fits]
    shifted = _shifted(live, search, fits, max(one.log_likelihood for one in judged) + _CLEARLY)
    fits += shifted
    judged += [search.judged(_path(live, fit.state)) for fit in shifted]
    paths, likelihoods = np.array([one.path for one in judged]), np.array([one.log_likelihood for one in judged])
    best = int(np.argmax(likelihoods))
    shares = np.exp((likelihoods - likelihoods.max()) / _LIKELY)
    apart = ((paths - paths[best]) ** 2).sum(axis=2) / 2.0
    spread = (shares[:, np.newaxis] * apart).sum(axis=0) / shares.sum()
    return replace(fits[best], pose_covariances=fits[best].pose_covariances + misfit_covariance(spread))


def strafes(ahead: LiveSolver, strafing: LiveSolver, without_faults: Sequence[Tuple[RunLog, Solution]] = ()) -> bool:
    """Return whether echoes are clearly likelier in the run of a solver that expects strafing, of the same scans.

    without_faults: what `strafing` had logged without faults, and runs of a vehicle that goes ahead without them.
    """

    def likelihood(run: Solution, log: RunLog) -> float:
        return log_likelihood(echoes_of_run(log, strafing.parameters), run.path(log.node_times)[:, :2])

    log = strafing.log
    others = [likelihood(run, logged) for logged, run in without_faults]
    return likelihood(strafing.solution, log) > _STRAFES * max([likelihood(ahead.solution, log), *others])


def _shift_search(live: LiveSolver) -> ShiftSearch:
    def refit(path: np.ndarray) -> np.ndarray:
        return _path(live, fit_path(live, _on_path(live, path)))

    echoes = echoes_of_run(live.log, live.parameters)
    return ShiftSearch(echoes, live.log.node_times.copy(), live.parameters.parts_per_turn, refit)


def _shifted(live: LiveSolver, search: ShiftSearch, fits: List[BatchResult], least: float) -> List[BatchResult]:
    """Return fits from paths that shifts of those of `fits` lead to, none if none has a log likelihood of `least`."""
    if live.log.scan_count > _LONGEST_SHIFTED * live.parameters.parts_per_turn:
        return []
    climbed = search.climbed([_path(live, fit.state) for fit in fits])
    if climbed[0].log_likelihood < least:
        return []
    best = [stretched_mean(search, climbed[0].path), *climbed[1:]]
    starts = [_on_path(live, one.path) for one in best]
    return [fit_of(live.solution.with_state(start), start) for start in starts]


def _on_path(live: LiveSolver, path: np.ndarray) -> State:
    """Return the unknowns of `live` with its newest nodes on `path` (k, 2) [m] in map."""
    start = live.state.copy()
    newest = np.arange(len(start.nodes) - len(path), len(start.nodes))
    start.nodes[newest] = on_path(start.nodes[newest], path, live.log.node_motion(newest))
    return start


def _path(live: LiveSolver, state: State) -> np.ndarray:
    """Return where the nodes are (n, 2) [m] in map."""
    return live.solution.with_state(state).places
