"""Whether a run fits its echoes elsewhere too: where piers repeat, nothing tells a compass alone how far it went."""

from dataclasses import replace
from typing import Iterator, List, NamedTuple, Tuple

import numpy as np

from mlsm_manager.joint_solver.batch_solver import BatchResult, QuickFit, compared_since
from mlsm_manager.joint_solver.solution import Solution
from mlsm_manager.self_check.causes import Cause
from mlsm_manager.self_check.motion_findings import MotionFindings

_SHIFTS = (-3.0, 3.0)  # m along the way: from there a fit finds places up to as far again, or comes back
_MOMENTS = 16  # about as many, from which on a run is shifted: each costs two fits
_STEP = 0.5  # m between nodes: with less the vehicle stands
_FEWEST = 8  # nodes: fewer meet in too few places
# Nats by which a run may be less likely elsewhere. Where piers repeat, the true place was from 1.5 nats less likely to
# 11 more likely than the one that was found.
_NATS = 5.0
# Times as many comparisons. True places had 0.96 and more. On a path that is too short more is compared, whatever is
# true: a vehicle that goes along a plain wall seemed to be 10 m behind with 1.02 times as many.
_AS_MANY = (0.95, 1.01)
_BEYOND = 2.0  # stated deviations: what is nearer is stated already. Unbroken runs in a marina had up to 1.6
_LEAST = 0.1  # m


class Elsewhere(NamedTuple):
    """A run that goes elsewhere from `begin` [s] on, and its fit.

    apart: (n, 2) m, how far its nodes lie beside. gain: of log likelihood, in as many comparisons.
    """

    begin: float
    run: Solution
    fit: QuickFit
    apart: np.ndarray
    gain: float


def with_other_places(found: MotionFindings) -> MotionFindings:
    """Return the findings of a run by a compass alone with the likeliest of the places where it may have gone.

    The farthest of the others makes it uncertain, and is named.
    """
    if not (found.is_alone and found.is_told) or found.run.parameters.node_search is not None:
        return found
    others = other_places(found.run, found.fit)
    if not others:
        return found
    best, farthest = max(others, key=lambda one: one.gain), max(others, key=lambda one: _metres(one.apart))
    text = f"echoes fit nearly as well with the vehicle {_metres(farthest.apart):.1f} m elsewhere,"
    found = replace(found, causes=[*found.causes, Cause(text, 0.0, farthest.begin)])
    if best.gain <= 0.0:
        return replace(found, apart=[*found.apart, farthest.apart])
    beside = max((-best.apart, farthest.apart - best.apart), key=_metres)
    return replace(found, run=best.run, fit=best.fit.with_covariances(), apart=[*found.apart, beside])


def _metres(apart: np.ndarray) -> float:
    return float(np.hypot(*apart.T).max())


def other_places(run: Solution, fit: BatchResult) -> List[Elsewhere]:
    """Return runs that are nearly as likely as the one at the state of `fit`, and lie farther away than that states.

    The fit starts again with all nodes from some moment on shifted along the way.
    """
    compared, likelihood = compared_since(run, np.nan)
    if len(fit.node_times) < _FEWEST or not compared:
        return []
    deviations = np.maximum(np.sqrt(np.trace(fit.pose_covariances[:, :2, :2], axis1=1, axis2=2)), _LEAST)
    found = []
    for node, shift in _starts(run.places):
        start = fit.state.copy()
        start.nodes[node:, :2] += shift
        other = QuickFit.of(run.with_state(start))
        shifted = run.with_state(other.state)
        apart = shifted.places - run.places
        apart -= apart[0]
        ratio = compared_since(shifted, np.nan)[0] / compared
        gain = other.log_likelihood - fit.log_likelihood - (ratio - 1.0) * likelihood
        is_far = np.mean((np.hypot(*apart.T) / deviations)[node:]) > _BEYOND
        if is_far and gain > -_NATS and _AS_MANY[0] < ratio < _AS_MANY[1]:
            found.append(Elsewhere(float(fit.node_times[node]), shifted, other, apart, gain))
    return found


def _starts(places: np.ndarray) -> Iterator[Tuple[int, np.ndarray]]:
    """Yield nodes of a path (n, 2), from which on it is to be shifted, and by what, (2,) m."""
    for node in range(2, len(places) - 2, max(len(places) // _MOMENTS, 1)):
        step = places[node + 1] - places[node - 1]
        length = float(np.hypot(*step))
        if length > 2.0 * _STEP:
            yield from ((node, shift * step / length) for shift in _SHIFTS)
