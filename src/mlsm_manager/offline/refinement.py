"""Fits a whole run after it is over, draws its map anew, and fits again to see whether the path depends on settings."""

from dataclasses import dataclass, replace
from typing import Callable, List, Mapping, Sequence

import numpy as np

from mlsm_manager.joint_solver.batch_solver import BatchResult, LoopClosure, fit_of, with_loops_closed
from mlsm_manager.joint_solver.normal_equations import State
from mlsm_manager.joint_solver.odometry_log import OdometryLog
from mlsm_manager.joint_solver.parameters import SolverParameters
from mlsm_manager.joint_solver.rival_solvers import RivalSolvers
from mlsm_manager.joint_solver.solution import Solution, solved_path
from mlsm_manager.localisation.keyframe_map import KeyframeMap, MapSettings
from mlsm_manager.localisation.odometry_profiles import fitted
from mlsm_manager.offline.replay import Replayed
from mlsm_manager.scan_matching.scan import MapCloud, Track
from mlsm_manager.self_check.causes import Fault
from mlsm_manager.self_check.fault_trials import without_faults
from mlsm_manager.self_check.motion_findings import MotionFindings
from mlsm_manager.self_check.other_places import with_other_places
from mlsm_manager.self_check.path_checks import settings_agree, starts_agree
from mlsm_manager.self_check.verdict import Verdict
from mlsm_manager.surface_map.blocks import Blocks
from mlsm_manager.surface_map.map_file import Layer


@dataclass(frozen=True)
class Refined:
    """poses: (m, 3) T_map_base at the recording's odometry times. layers: of the map drawn anew.

    closing: places visited again that the fit goes back to. motion: the run as fitted, and what speaks against its
    odometry.
    """

    poses: np.ndarray
    layers: Mapping[Layer, Blocks]
    closing: LoopClosure
    motion: MotionFindings


Done = Callable[[], object]  # called after each part of a long work
REFITS = 5  # parts of `refitted_verdicts`


def parts_of_refining(rivals: RivalSolvers) -> int:
    """Return how often `refine` says that a part is done: the fit of each odometry, loops, faults, the map."""
    return len(rivals.solvers) + 3


def refine(
    replayed: Replayed, track: Track, settings: MapSettings, suspected: Sequence[Fault], ranges_told: bool,
    done: Done,
) -> Refined:  # fmt: skip
    """Return the run of all scans that the solvers have taken, fitted at once; live runs are where fits begin.

    Of several odometries the likelier one is believed from then on. suspected: of sonar or odometry, which said
    `track`; see without_faults.
    """
    rivals = replayed.rivals
    fits = []
    for solver in rivals.solvers:
        fits.append(fitted(solver))
        done()
    best, solver = rivals.believed(fits), rivals.shown
    closing = with_loops_closed(solver, best)
    done()
    run = solver.solution.with_state(closing.batch.state)
    motion = with_other_places(without_faults(run, closing.batch, track, suspected, ranges_told))
    done()
    surfaces = KeyframeMap(settings.resolution, settings.limit, carver=settings.carver)
    for scan in replayed.scans:
        surfaces.add(MapCloud.of_scan(motion.placed(scan, track, replayed.solver.log.sonar_in_base)))
    surfaces.settle(motion.run)
    whole, batch = OdometryLog.of(motion.track), motion.fit
    poses = solved_path(whole, solver.odometry, batch.node_times, batch.state.nodes, track.times)
    layers = {Layer.SHOWN: surfaces.map.blocks, Layer.FREE: surfaces.free.blocks}
    done()
    return Refined(poses, layers, closing, motion.with_course(Track(track.times, poses)))


_NARROWER, _WIDER, _HALF = 0.75, 1.4, 0.5  # factors of settings that nobody knows better than that
_MORE_SCANS = 2
_MANY_SCANS = 40  # in a group, from which on it is made smaller
_TURNS = 1.0  # of the direction in which the second start lies beside the path, along the whole run


def refitted_verdicts(run: Solution, batch: BatchResult, done: Done = lambda: None) -> List[Verdict]:
    """Return what further fits of a run say of `batch`, its fit with its own settings."""

    def refitted(other: Solution) -> State:
        state = fit_of(other).state
        done()
        return state

    def path(state: State) -> np.ndarray:
        return run.with_state(state).places

    deviations = np.sqrt(np.trace(batch.pose_covariances[:, :2, :2], axis1=1, axis2=2))
    start = displaced(batch.state, deviations, run.parameters.cut)
    fitted_with = [replace(run, parameters=one, state=batch.state) for one in other_settings(run.parameters)]
    paths = np.stack([path(state) for state in (batch.state, *(refitted(one) for one in fitted_with))])
    again = [path(state) for state in (batch.state, start, refitted(run.with_state(start)))]
    return [settings_agree(batch.node_times, paths, deviations), starts_agree(batch.node_times, *again)]


def other_settings(parameters: SolverParameters) -> List[SolverParameters]:
    """Return a handful of parameters, each of which differs from `parameters` in one setting of the comparisons."""
    more = _MORE_SCANS if parameters.scans_per_group < _MANY_SCANS else -_MORE_SCANS
    changes = (
        {"cut": _NARROWER * parameters.cut},
        {"echo_deviation": _WIDER * parameters.echo_deviation},
        {"weight": _HALF * parameters.weight},
        {"scans_per_group": parameters.scans_per_group + more},
    )
    return [replace(parameters, **change) for change in changes]


def displaced(state: State, deviations: np.ndarray, most: float) -> State:
    """Return a state whose nodes lie one stated deviation (n,) [m] beside those of `state`, but at most `most` [m].

    The direction turns slowly along the run, so that scans of one time still agree with each other.
    """
    angles = 2.0 * np.pi * _TURNS * np.linspace(0.0, 1.0, len(deviations))
    moved = state.copy()
    moved.nodes[:, :2] += (np.minimum(deviations, most) * [np.cos(angles), np.sin(angles)]).T
    return moved
