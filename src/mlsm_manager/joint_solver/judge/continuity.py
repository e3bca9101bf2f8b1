"""How much of each scan lies on what was heard just before it."""

from typing import Tuple

import numpy as np
from scipy.spatial import cKDTree

from mlsm_manager.joint_solver.measured.run_log import RunLog
from mlsm_manager.joint_solver.motion.motion_models import OdometryModel
from mlsm_manager.joint_solver.parameters import SolverParameters
from mlsm_manager.joint_solver.placing.placement import PlacedPoints, place
from mlsm_manager.joint_solver.unknowns.state import State

_TURNS_BEFORE = 10  # a few minutes, in which a vehicle sees the same
_SURROUNDINGS = 8.0  # m around a point within which surfaces may be the one that it lies on, or lie beside it
_ON_SURFACE = 1.0  # m: about twice the deviation of an echo
_CANDIDATES = 24  # points heard before that are looked at for each point: enough to find one that faces the same way
_FEWEST_POINTS = 2.0  # points with surfaces around them: fewer tell nothing


def shares_heard_before(
    log: RunLog, odometry: OdometryModel, state: State, parameters: SolverParameters, first: int
) -> np.ndarray:
    """Return which share (n,) of the points of turns `first` and newer lies on surfaces that those before heard.

    Only points count around which a surface was heard that faces the same way: others may be new. NaN for turns with
    hardly any such points. A turn is a scan, or all its parts.
    """
    turns = range(first, log.scan_count // parameters.parts_per_turn)
    return np.array([_share(log, odometry, state, parameters, turn) for turn in turns])


def _share(log: RunLog, odometry: OdometryModel, state: State, parameters: SolverParameters, turn: int) -> float:
    parts = parameters.parts_per_turn
    before = log.rows(parts * max(0, turn - _TURNS_BEFORE), parts * turn)
    own = log.rows(parts * turn, parts * (turn + 1))
    if not len(before) or not len(own):
        return np.nan
    sources, targets = (place(log, odometry, state, rows) for rows in (own, before))
    distances, known = _distances(sources, targets, parameters)
    total = sources.qualities[known].sum()
    if total <= _FEWEST_POINTS:
        return np.nan
    return float(sources.qualities[known] @ np.exp(-0.5 * (distances[known] / _ON_SURFACE) ** 2) / total)


def _distances(sources: PlacedPoints, targets: PlacedPoints, parameters: SolverParameters) -> Tuple[np.ndarray, ...]:
    """Return how far (n,) [m] each source is from the nearest target that faces the same way, and where one is near."""
    distance, index = cKDTree(targets.places).query(sources.places, k=_CANDIDATES, distance_upper_bound=_SURROUNDINGS)
    found = np.isfinite(distance)
    facing = np.einsum("na,nka->nk", sources.normals, targets.normals[np.where(found, index, 0)])
    nearest = np.where(found & (facing > parameters.min_cosine), distance, np.inf).min(axis=1)
    return nearest, np.isfinite(nearest)
