"""Fits a whole run from several paths that the vehicle may have gone, and keeps the likeliest fit."""

from dataclasses import replace
from typing import List

import numpy as np

from mlsm_manager.hovering.particle_filter import ParticleFilter, on_path
from mlsm_manager.hovering.particles import echoes_of_run
from mlsm_manager.hovering.path_agreement import log_likelihood
from mlsm_manager.hovering.shift_search import ShiftSearch, stretched_mean
from mlsm_manager.joint_solver.batch_solver import BatchResult, fit_of, fit_path
from mlsm_manager.joint_solver.estimate import misfit_covariance
from mlsm_manager.joint_solver.live_solver import LiveSolver
from mlsm_manager.joint_solver.normal_equations import State

_FILTERS = 3  # besides the live one: one of three or four loses a simulated tour now and then
_ALL_TURNS = 200  # that particles reach back: all of a run of 50 minutes
_LIKELY = 20.0  # of log likelihood, by which a fit must be worse to count e times less, since neighbours share errors
_LONGEST_SHIFTED = 60  # turns, about 15 minutes: the time that shifts take grows with their square
_CLEARLY = 3.0  # of log likelihood, by which shifted paths must be better than the best fit before, or it is kept
# Times the likelihood: 1.01 on tours ahead, where the wider profile fits noise; 1.25 and more on others.
_STRAFES = 1.05


def solved_best(live: LiveSolver) -> BatchResult:
    """Return the fit of all scans that `live` has taken: from where it found them, and from paths found anew.

    Places that differ between fits that are about as likely are uncertain by as much.
    """
    starts = [live.state, *(_found(live, seed) for seed in range(1, _FILTERS + 1))]
    fits = [fit_of(live.solution.with_state(start)) for start in starts]
    search = _shift_search(live)
    likelihoods = [search.judged(_path(live, fit.state)).log_likelihood for fit in fits]
    for better in _shifted(live, search, fits, max(likelihoods) + _CLEARLY):
        fits.append(better)
        likelihoods.append(search.judged(_path(live, better.state)).log_likelihood)
    return _best(live, fits, np.array(likelihoods))


def strafes(ahead: LiveSolver, strafing: LiveSolver) -> bool:
    """Return whether echoes are clearly likelier in the run of a solver that expects strafing, of the same scans."""
    times = strafing.log.node_times
    echoes = echoes_of_run(strafing.log, strafing.parameters)
    one, other = (log_likelihood(echoes, run.solution.path(times)[:, :2]) for run in (ahead, strafing))
    return other > _STRAFES * one


def _found(live: LiveSolver, seed: int) -> State:
    """Return the unknowns on the likeliest path that a particle filter of the whole run finds."""
    found = ParticleFilter(seed=seed, remembered_turns=_ALL_TURNS).followed(live.log, live.parameters)
    return _on_path(live, found.particles.most_likely())


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
    return live.solution.with_state(state).node_places(np.arange(len(state.nodes)))


def _best(live: LiveSolver, fits: List[BatchResult], likelihoods: np.ndarray) -> BatchResult:
    paths, best = np.array([_path(live, fit.state) for fit in fits]), int(np.argmax(likelihoods))
    shares = np.exp((likelihoods - likelihoods.max()) / _LIKELY)
    apart = ((paths - paths[best]) ** 2).sum(axis=2) / 2.0
    spread = (shares[:, np.newaxis] * apart).sum(axis=0) / shares.sum()
    return replace(fits[best], pose_covariances=fits[best].pose_covariances + misfit_covariance(spread))
