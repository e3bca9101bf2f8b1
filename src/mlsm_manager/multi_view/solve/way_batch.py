"""Fits a whole run from several ways that the vehicle may have gone, and keeps the fit that agrees best."""

from dataclasses import replace
from typing import List

import numpy as np

from mlsm_manager.multi_view.placing.estimate import misfit_covariance
from mlsm_manager.multi_view.solve.batch_solver import BatchResult, solved
from mlsm_manager.multi_view.solve.live_solver import LiveSolver
from mlsm_manager.multi_view.unknowns.state import State
from mlsm_manager.multi_view.ways.way_nodes import on_path
from mlsm_manager.multi_view.ways.way_search import WaySearch, agreement_of, needs_ways

_SEARCHES = 3  # besides the live one: one of three or four loses a simulated tour now and then
_ALL_TURNS = 200  # that ways reach back: all of a run of 50 minutes
_LIKELY = 10.0  # nats: a fit that agrees less by so much is believed e times less, since neighbours share errors


def solved_best(live: LiveSolver) -> BatchResult:
    """Return the fit of all scans that `live` has taken: from where it found them, and from ways found anew.

    Where the motion is reported, or hardly changes within a turn, the first is the only one. Places that differ
    between fits that agree about as well are uncertain by as much.
    """
    fits = [solved(live)]
    if needs_ways(live.odometry, live.parameters.matching):
        fits += [solved(live, start=_found(live, seed)) for seed in range(1, _SEARCHES + 1)]
    return _best(live, fits) if len(fits) > 1 else fits[0]


def _found(live: LiveSolver, seed: int) -> State:
    """Return the unknowns on the ways that a search of the whole run believes most."""
    search = WaySearch(live.parameters, seed=seed, remembered_turns=_ALL_TURNS).followed(live.log)
    path, start = search.ways.most_believed(), live.state.copy()
    newest = np.arange(len(start.nodes) - len(path), len(start.nodes))
    start.nodes[newest] = on_path(start.nodes[newest], path, live.log.node_motion(newest))
    return start


def _best(live: LiveSolver, fits: List[BatchResult]) -> BatchResult:
    nodes = np.arange(len(live.log.node_times))
    reported = live.log.node_poses(nodes)[:, :2]
    paths = np.array([reported + fit.state.nodes[:, :2] for fit in fits])
    nats = np.array([agreement_of(live.log, live.parameters, path) for path in paths])
    best = int(np.argmax(nats))
    shares = np.exp((nats - nats.max()) / _LIKELY)
    apart = ((paths - paths[best]) ** 2).sum(axis=2) / 2.0
    spread = (shares[:, np.newaxis] * apart).sum(axis=0) / shares.sum()
    return replace(fits[best], pose_covariances=fits[best].pose_covariances + misfit_covariance(spread))
