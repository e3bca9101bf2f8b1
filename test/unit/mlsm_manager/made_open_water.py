"""Water with nothing in it: no scan of noise may lead to a fix."""

from dataclasses import dataclass
from typing import Callable

import numpy as np
from made_recordings import scans_in

from mlsm_manager.localisation.parameters import EstimatorName
from mlsm_manager.offline.recording import Recording
from mlsm_manager.offline.replay import ReplayParameters, replay
from mlsm_manager.scan_matching.scan import Track
from node_support.geometry import matrices
from sonar_processing.beams.beam import Beam, PlacedBeam

_BEAMS, _BINS, _RESOLUTION = 120, 250, 0.2
_SECONDS_PER_TURN = 16.0
_START = 1000.0
_SPEED, _TURN_RATE = 0.3, 0.01  # m/s, rad/s: circles of 30 m, so that the vehicle comes back
_SPECKLE = 6.0  # Echo strength: mean of a receiver's noise at a usual gain
_BUBBLES, _BUBBLE_STRENGTH = 30, 120.0  # Echoes of a turn that nothing stands behind

Turn = Callable[[np.random.Generator], np.ndarray]
"""Makes strengths (beams, bins) of a turn of the head."""


@dataclass(frozen=True)
class Outcome:
    """fixes: scans whose match was accepted. farthest: m, the largest correction of a position."""

    scans: int
    fixes: int
    farthest: float


def speckle(rng: np.random.Generator) -> np.ndarray:
    """Return a turn of receiver noise: amplitudes of Rayleigh's distribution."""
    return rng.rayleigh(_SPECKLE / np.sqrt(np.pi / 2.0), (_BEAMS, _BINS))


def bubbles(rng: np.random.Generator) -> np.ndarray:
    """Return a turn of receiver noise with a few strong echoes that are elsewhere in the next turn."""
    strengths = speckle(rng)
    strengths[rng.integers(0, _BEAMS, _BUBBLES), rng.integers(5, _BINS, _BUBBLES)] = _BUBBLE_STRENGTH
    return strengths


def recording(turn: Turn, scans: int, seed: int) -> Recording:
    """Return a recording of a vehicle that drives circles in open water."""
    times, rng = _START + np.arange(scans * _BEAMS + 1) * _SECONDS_PER_TURN / _BEAMS, np.random.default_rng(seed)
    yaws, radius = _TURN_RATE * (times - _START), _SPEED / _TURN_RATE
    poses = np.column_stack([radius * np.sin(yaws), radius * (1.0 - np.cos(yaws)), yaws])
    strengths = np.concatenate([np.clip(np.rint(turn(rng)), 0, 255) for _ in range(scans)]).astype(np.uint8)
    angles = np.tile(2.0 * np.pi * np.arange(_BEAMS) / _BEAMS, scans)
    beams = [
        PlacedBeam(Beam(round(1e9 * time), "sonar", angle, row, _RESOLUTION), pose, is_moving=True)
        for time, angle, row, pose in zip(times, angles, strengths, matrices(poses))
    ]
    return Recording(beams, 0, Track(times, poses), None)


def outcome(turn: Turn, estimator: EstimatorName, scans: int, seed: int) -> Outcome:
    """Map open water as map_bag does."""
    made = recording(turn, scans, seed)
    parameters = ReplayParameters(estimator=estimator)
    found = scans_in(made, parameters.echoes())
    replayed = replay(made, found, parameters, lambda _: None)
    fixes = sum(update.accepted and update.result is not None for update in replayed.updates)
    return Outcome(len(found), fixes, float(np.hypot(*(replayed.corrected - replayed.odometry)[:, :2].T).max()))
