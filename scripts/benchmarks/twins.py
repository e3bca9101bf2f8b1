"""Twins of a recorded run: its path and timing, in other water and with other errors."""

from dataclasses import replace

import numpy as np

from benchmarks.twin_conditions import TwinParameters, reported, true_path
from benchmarks.twin_water import heard, made_water
from mlsm_manager.offline.recording import Recording, Truth
from node_support.geometry import matrices
from sonar_processing.beams.beam import PlacedBeam

_AT_ENDS = 2.0  # s at both ends of the recording without beams, so that odometry covers delayed beams


def twin_of(source: Recording, parameters: TwinParameters) -> Recording:
    """Return a recording with the path and timing of `source` and conditions of its own; the truth is known."""
    rng = np.random.RandomState(parameters.seed)
    path = true_path(source.track, parameters)
    water = made_water(path.poses[:, :2], parameters, rng)
    odometry = reported(path, parameters, rng)
    stamps = np.array([placed.beam.stamp_ns for placed in source.beams]) * 1e-9
    inside = (stamps > path.times[0] + _AT_ENDS) & (stamps < path.times[-1] - _AT_ENDS)
    beams = [placed.beam for placed, kept in zip(source.beams, inside) if kept]
    stamps = stamps[inside]
    T_base_sonar = (
        np.linalg.inv(matrices(source.track.at(stamps[:1]))[0])
        @ source.beams[int(np.flatnonzero(inside)[0])].T_target_sonar
    )
    mounting = np.arctan2(T_base_sonar[1, 0], T_base_sonar[0, 0])
    bearings = np.array([beam.angle for beam in beams]) + mounting
    poses = path.at(stamps + parameters.delay)
    strengths = heard(water, poses, bearings, T_base_sonar[:2, 3], parameters, rng)
    places = matrices(odometry.at(stamps)) @ T_base_sonar
    made = [
        PlacedBeam(replace(beam, intensities=row), place, True) for beam, row, place in zip(beams, strengths, places)
    ]
    times = np.arange(path.times[0], path.times[-1], 1.0)
    return Recording(made, 0, odometry, Truth(times, path.at(times)[:, :2]))
