"""Simulated scans for the figures of matching: worlds, vehicles on scripts, echoes, scans with a wrong odometry."""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Callable, Tuple

import numpy as np

from mlsm_manager.matching.planar import rotated
from mlsm_manager.matching.scan import Scan, Track
from sonar_processing.echo_extraction import EchoExtractorParameters, extract_echoes
from sonar_simulator.beam_pattern import BeamPattern
from sonar_simulator.laser_cone import LaserCone, LaserConeParameters
from sonar_simulator.poses import pose_matrix
from sonar_simulator.ray_caster import RayCaster
from sonar_simulator.sonar_head import Sonar, SonarHead

ROOT = Path(__file__).resolve().parents[2]
RAYS = {45: (15, 3), 500: (50, 10)}
HEAD = SonarHead(beams_per_turn=120, seconds_per_turn=16.0)
DEPTH = -2.0
Poses = Callable[[np.ndarray], np.ndarray]
"""From times (n,) to planar poses (n, 3)."""


@dataclass(frozen=True)
class SonarKind:
    """How the sonar hears: rays per beam and the standard deviation of an echo along range, m."""

    rays: int
    spread: float

    def __str__(self) -> str:
        return f"{self.rays} rays, pulse {self.spread:g} m"


class ScanMaker:
    """Makes scans in one world with one sonar; the same seed makes the same scan."""

    def __init__(self, caster: RayCaster, kind: SonarKind) -> None:
        self._caster = caster
        self._pattern = BeamPattern(math.radians(22.0), math.radians(2.5), *RAYS[kind.rays])
        self._model = LaserCone(LaserConeParameters(spread=kind.spread))
        self._extraction = EchoExtractorParameters(pulse_sigma=kind.spread, min_height=2.0)

    def scan(self, true_pose: Poses, odometry: Poses, turn: int, moving: bool, seed: int) -> Scan:
        """Return the scan of head turn number `turn`, its points placed by the odometry."""
        numbers = turn * HEAD.beams_per_turn + np.arange(HEAD.beams_per_turn)
        times = np.array([HEAD.time(int(number)) for number in numbers])
        angles = np.array([HEAD.angle(int(number)) for number in numbers])
        bearing, ranges, heights = self.echoes(true_pose(times), angles, seed)
        poses = odometry(times)
        arms = ranges[:, np.newaxis] * np.column_stack([np.cos(angles[bearing]), np.sin(angles[bearing])])
        places = poses[bearing, :2] + rotated(arms, poses[bearing, 2])
        points = np.column_stack([places, np.full(len(ranges), DEPTH), heights])
        track_times = np.linspace(times[0] - 2.0, times[-1], 200)
        track = Track(track_times, odometry(track_times))
        return Scan(points, times[bearing], np.full(len(points), moving), track, float(times[-1]))

    def echoes(self, poses: np.ndarray, angles: np.ndarray, seed: int) -> Tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return beam number, range [m] and height of the echoes heard from `poses` (b, 3) at head `angles` (b,)."""
        sonar = Sonar(self._caster, self._pattern, self._model, np.random.default_rng(seed))
        matrices = np.array([pose_matrix((x, y, DEPTH), (0.0, 0.0, yaw)) for x, y, yaw in poses])
        echoes = extract_echoes(sonar.pings(matrices, angles), sonar.range_resolution, self._extraction)
        return echoes.beams, (echoes.bins + 0.5) * sonar.range_resolution, echoes.heights
