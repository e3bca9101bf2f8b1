"""Fits a whole run from several ways that the vehicle may have gone, and keeps the fit that agrees best."""

from dataclasses import replace
from typing import List

import numpy as np

from mlsm_manager.joint_solver.placing.estimate import misfit_covariance
from mlsm_manager.joint_solver.shifting.shift_search import ShiftSearch
from mlsm_manager.joint_solver.shifting.stretched_mean import stretched_mean
from mlsm_manager.joint_solver.solve.batch_solver import BatchResult, settled, solved
from mlsm_manager.joint_solver.solve.live_solver import LiveSolver
from mlsm_manager.joint_solver.unknowns.state import State
from mlsm_manager.joint_solver.ways.way_echoes import WayEchoes
from mlsm_manager.joint_solver.ways.way_nodes import on_path
from mlsm_manager.joint_solver.ways.way_search import WaySearch, needs_ways

_SEARCHES = 3  # besides the live one: one of three or four loses a simulated tour now and then
_ALL_TURNS = 200  # that ways reach back: all of a run of 50 minutes
_LIKELY = 20.0  # nats: a fit that is worth less by so much is believed e times less, since neighbours share errors
_LONGEST_SHIFTED = 60  # turns, about 15 minutes: the time that shifts take grows with their square
_CLEARLY = 3.0  # nats by which shifted paths must be better than the best fit before, or else that one is good enough


def solved_best(live: LiveSolver) -> BatchResult:
    """Return the fit of all scans that `live` has taken: from where it found them, and from ways found anew.

    Where the motion is reported, or hardly changes within a turn, the first is the only one. Places that differ
    between fits that agree about as well are uncertain by as much.
    """
    if not needs_ways(live.odometry, live.parameters.matching):
        return solved(live)
    fits = [solved(live), *(solved(live, start=_found(live, seed)) for seed in range(1, _SEARCHES + 1))]
    search = _shift_search(live)
    nats = [search.judged(_path(live, fit.state)).nats for fit in fits]
    for better in _shifted(live, search, fits, max(nats) + _CLEARLY):
        fits.append(better)
        nats.append(search.judged(_path(live, better.state)).nats)
    return _best(live, fits, np.array(nats))


def _found(live: LiveSolver, seed: int) -> State:
    """Return the unknowns on the ways that a search of the whole run believes most."""
    search = WaySearch(live.parameters, seed=seed, remembered_turns=_ALL_TURNS).followed(live.log)
    return _on_path(live, search.ways.most_believed())


def _shift_search(live: LiveSolver) -> ShiftSearch:
    log, parameters = live.log, live.parameters
    echoes = WayEchoes.of_run(log, parameters.odometry, parameters)

    def refit(path: np.ndarray) -> np.ndarray:
        return _path(live, settled(live, _on_path(live, path)))

    return ShiftSearch(echoes, log.node_times.copy(), parameters.matching.scan_parts, refit)


def _shifted(live: LiveSolver, search: ShiftSearch, fits: List[BatchResult], least: float) -> List[BatchResult]:
    """Return fits from paths that shifts of those of `fits` lead to, none if none is worth `least` nats."""
    if live.log.scan_count > _LONGEST_SHIFTED * live.parameters.matching.scan_parts:
        return []
    climbed = search.climbed([_path(live, fit.state) for fit in fits])
    if climbed[0].nats < least:
        return []
    best = [stretched_mean(search, climbed[0].path), *climbed[1:]]
    starts = [_on_path(live, one.path) for one in best]
    return [solved(live, start=start, told=start) for start in starts]


def _on_path(live: LiveSolver, path: np.ndarray) -> State:
    """Return the unknowns of `live` with its newest nodes on `path` (k, 2) [m] in map."""
    start = live.state.copy()
    newest = np.arange(len(start.nodes) - len(path), len(start.nodes))
    start.nodes[newest] = on_path(start.nodes[newest], path, live.log.node_motion(newest))
    return start


def _path(live: LiveSolver, state: State) -> np.ndarray:
    """Return where the nodes are (n, 2) [m] in map."""
    return live.log.node_poses(np.arange(len(state.nodes)))[:, :2] + state.nodes[:, :2]


def _best(live: LiveSolver, fits: List[BatchResult], nats: np.ndarray) -> BatchResult:
    paths, best = np.array([_path(live, fit.state) for fit in fits]), int(np.argmax(nats))
    shares = np.exp((nats - nats.max()) / _LIKELY)
    apart = ((paths - paths[best]) ** 2).sum(axis=2) / 2.0
    spread = (shares[:, np.newaxis] * apart).sum(axis=0) / shares.sum()
    return replace(fits[best], pose_covariances=fits[best].pose_covariances + misfit_covariance(spread))
