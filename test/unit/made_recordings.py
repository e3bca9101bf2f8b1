"""A small recording: a vehicle circles in a walled basin, without a simulator."""

import numpy as np

from mlsm_manager.offline.recording import Recording
from mlsm_manager.scan_matching.scan import Track
from node_support.geometry import matrices
from sonar_processing.beams.beam import Beam, PlacedBeam

SECONDS = 300.0
_START = 1000.0
_RADIUS, _WALL = 8.0, 20.0  # m
_BINS, _RESOLUTION = 100, 0.3
_BEAM, _STEP = 0.5, np.radians(12.0)


def circling() -> Recording:
    """Return 300 s of it, with a beam each half second and a pose each tenth."""
    times = _START + np.arange(0.0, SECONDS + 0.05, 0.1)
    angle = 2.0 * np.pi * (times - _START) / SECONDS
    track = Track(times, np.column_stack([_RADIUS * np.cos(angle), _RADIUS * np.sin(angle), angle + np.pi / 2.0]))
    beams = []
    for number, time in enumerate(np.arange(_START + 1.0, _START + SECONDS - 1.0, _BEAM)):
        pose, head = track.at(np.array(time)), number * _STEP
        beam = Beam(round(1e9 * time), "sonar", head, _heard(pose, head), _RESOLUTION)
        beams.append(PlacedBeam(beam, matrices(pose[np.newaxis])[0], True))
    return Recording(beams, 0, track, None)


def _heard(pose: np.ndarray, head: float) -> np.ndarray:
    """Return strengths (bins,) of a beam in a square basin."""
    ahead = np.array([np.cos(pose[2] + head), np.sin(pose[2] + head)])
    away = np.where(ahead > 0.0, _WALL - pose[:2], _WALL + pose[:2]) / np.maximum(np.abs(ahead), 1e-9)
    strengths = np.zeros(_BINS, dtype=np.uint8)
    place = int(away.min() / _RESOLUTION)
    strengths[place : place + 3] = 100
    return strengths
