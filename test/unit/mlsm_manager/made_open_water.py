"""Water with nothing in it but a receiver's noise and bubbles."""

import numpy as np

from mlsm_manager.offline.recording import Recording
from mlsm_manager.scan_matching.scan import Track
from node_support.geometry import matrices
from sonar_processing.beams.beam import Beam, PlacedBeam

_BEAMS, _BINS, _RESOLUTION = 120, 250, 0.2
_SECONDS_PER_TURN = 16.0
_START = 1000.0
_SPEED, _TURN_RATE = 0.3, 0.01  # m/s, rad/s: circles of 30 m, so that the vehicle comes back
_SPECKLE = 6.0  # Echo strength: mean of a receiver's noise at a usual gain
_BUBBLES, _BUBBLE_STRENGTH = 30, 120.0  # Echoes of a turn that nothing stands behind


def open_water(scans, seed):
    """Return a recording of so many turns of the head on a vehicle that drives circles."""
    times, rng = _START + np.arange(scans * _BEAMS + 1) * _SECONDS_PER_TURN / _BEAMS, np.random.default_rng(seed)
    yaws, radius = _TURN_RATE * (times - _START), _SPEED / _TURN_RATE
    poses = np.column_stack([radius * np.sin(yaws), radius * (1.0 - np.cos(yaws)), yaws])
    strengths = np.concatenate([_strengths(rng) for _ in range(scans)])
    angles = np.tile(2.0 * np.pi * np.arange(_BEAMS) / _BEAMS, scans)
    beams = [
        PlacedBeam(Beam(round(1e9 * time), "sonar", angle, row, _RESOLUTION), pose, is_moving=True)
        for time, angle, row, pose in zip(times, angles, strengths, matrices(poses))
    ]
    return Recording(beams, 0, Track(times, poses), None)


def _strengths(rng):
    """Return a turn (beams, bins): amplitudes of Rayleigh, and bubbles that are elsewhere in the next one."""
    strengths = rng.rayleigh(_SPECKLE / np.sqrt(np.pi / 2.0), (_BEAMS, _BINS))
    strengths[rng.integers(0, _BEAMS, _BUBBLES), rng.integers(5, _BINS, _BUBBLES)] = _BUBBLE_STRENGTH
    return np.clip(np.rint(strengths), 0, 255).astype(np.uint8)
