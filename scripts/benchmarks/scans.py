"""Simulated scans: of a vehicle that stays or moves under a wrong odometry, and as the cloud of a still sonar."""

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Callable, Optional, Tuple

import numpy as np

from benchmarks.harness import ROOT
from mlsm_manager.scan_matching.scan import Scan, Track
from node_support.geometry import pose_matrix, rotated
from sonar_processing.beams.beam import Beam, PlacedBeam
from sonar_processing.cloud import Cloud
from sonar_processing.filters.echo_extractor import EchoExtractorParameters, ExtractionMode, extract_echoes
from sonar_processing.scans.assembler import ScanAssembler
from sonar_processing.scans.parameters import SonarToCloudParameters
from sonar_simulator.echoes.beam_tracer import BeamPattern
from sonar_simulator.echoes.echo_model import make_echo_model
from sonar_simulator.echoes.ray_caster import RayCaster
from sonar_simulator.echoes.thesis_models import LaserCone, LaserConeParameters
from sonar_simulator.simulation.sonar_head import Sonar, SonarHead, SonarParameters
from sonar_simulator.world.world import Shape, World
from sonar_simulator.world.world_file import load_world

RAYS = {15: (5, 3), 45: (15, 3), 150: (30, 5), 500: (50, 10)}
HEAD = SonarHead(beams_per_turn=120, seconds_per_turn=16.0)
DEPTH = -2.0
_FLOOR = Shape("floor", "box", pose_matrix((0.0, 0.0, -6.0)), (400.0, 400.0, 1.0))
_WALL = Shape("wall", "box", pose_matrix((0.0, 15.5, -2.5)), (400.0, 1.0, 6.0))
WORLDS: dict = {
    "basin": lambda: load_world(ROOT / "worlds/basin.sdf"),
    "empty sea": lambda: World.from_shapes("empty sea", [_FLOOR]),
    "straight wall": lambda: World.from_shapes("straight wall", [_FLOOR, _WALL]),
}
_ORGANIZED = SonarToCloudParameters(keep_organized=True)
Poses = Callable[[np.ndarray], np.ndarray]
"""From times (n,) to planar poses (n, 3)."""


@dataclass(frozen=True)
class SonarKind:
    """How the sonar hears: rays per beam and the standard deviation of an echo along range, m.

    The demo's head has a pulse of 0.15 m, the thesis's model one of 1 m. pulse_sigma: width of the extractor's matched
    filter, m; twice the short pulse, since noise punches holes into an echo that saturates. noise_echoes: in each beam.
    """

    rays: int
    spread: float
    pulse_sigma: float
    noise_echoes: int = LaserConeParameters().noise_echoes

    def __str__(self) -> str:
        return f"{self.rays} rays, pulse {self.spread:g} m"


KINDS = (SonarKind(500, 0.15, 0.3), SonarKind(45, 0.15, 0.3), SonarKind(500, 1.0, 1.0), SonarKind(45, 1.0, 1.0))


def still(pose: np.ndarray) -> Poses:
    """Return the poses of a vehicle that stays at `pose` (3,)."""
    return lambda times: np.tile(np.asarray(pose, dtype=np.float64), (len(times), 1))


def head_turn(number: int) -> Tuple[np.ndarray, np.ndarray]:
    """Return times and head angles (b,) of the beams of turn number `number`."""
    beams = range(number * HEAD.beams_per_turn, (number + 1) * HEAD.beams_per_turn)
    return np.array([HEAD.time(beam) for beam in beams]), np.array([HEAD.angle(beam) for beam in beams])


def at_depth(poses: np.ndarray) -> np.ndarray:
    """Return planar poses (n, 3) as matrices (n, 4, 4) at the vehicle's depth."""
    return np.array([pose_matrix((x, y, DEPTH), (0.0, 0.0, yaw)) for x, y, yaw in poses])


class ScanMaker:
    """Makes scans in one world with one sonar; the same seed makes the same scan."""

    def __init__(self, world: str, kind: SonarKind) -> None:
        self._caster = _caster(world)
        self._pattern = BeamPattern(math.radians(22.0), math.radians(2.5), *RAYS[kind.rays])
        self._model = LaserCone(LaserConeParameters(spread=kind.spread, noise_echoes=kind.noise_echoes))
        self._extraction = EchoExtractorParameters(
            mode=ExtractionMode.MATCHED_FILTER, pulse_sigma=kind.pulse_sigma, threshold_share=1.0
        )

    def scan(
        self, true_pose: Poses, odometry: Poses, seed: int, turn: int = 0, moving: bool = False,
        track: Optional[Track] = None,
    ) -> Scan:  # fmt: skip
        """Return the scan of head turn number `turn`, its points placed by the odometry."""
        times, angles = head_turn(turn)
        sonar = self.sonar(seed)
        strengths = sonar.pings(at_depth(true_pose(times)), angles)
        echoes, _ = extract_echoes(strengths, sonar.range_resolution, self._extraction)
        beams, ranges = echoes.beams, (echoes.bins + 0.5) * sonar.range_resolution
        poses = odometry(times)
        arms = ranges[:, np.newaxis] * np.column_stack([np.cos(angles[beams]), np.sin(angles[beams])])
        places = poses[beams, :2] + rotated(arms, poses[beams, 2])
        points = np.column_stack([places, np.full(len(ranges), DEPTH), echoes.heights])
        if track is None:
            track = Track(times, poses)
        return Scan(points, times[beams], np.full(len(points), moving), track, float(times[-1]))

    def sonar(self, seed: int) -> Sonar:
        """Return the sonar with the noise of a seed."""
        return Sonar(self._caster, self._pattern, self._model, np.random.default_rng(seed))


def noise_scan(points: int, seed: int) -> Scan:
    """Return a scan that hears `points` echoes anywhere within 50 m."""
    rng = np.random.default_rng(seed)
    times = np.sort(rng.uniform(0.0, 16.0, points))
    places = rng.uniform(-50.0, 50.0, (points, 2))
    cloud = np.column_stack([places, np.full(points, DEPTH), np.full(points, 50.0)])
    track = Track(np.linspace(0.0, 16.0, 33), np.zeros((33, 3)))
    return Scan(cloud, times, np.zeros(points, dtype=bool), track, 16.0)


def basin_cloud(
    spread: float, T_world_sonar: np.ndarray, seed: int, parameters: SonarToCloudParameters = _ORGANIZED
) -> Cloud:
    """Return the full turn of 120 beams and 50 m heard from a (4, 4) pose in the basin, in the world frame.

    spread: of the echoes, m. The cloud is organised unless told otherwise.
    """
    usual = SonarParameters()
    head = SonarHead(usual.beams_per_turn, usual.seconds_per_turn)
    angles = np.array([head.angle(beam) for beam in range(head.beams_per_turn)])
    model = make_echo_model("laser_cone", {"spread": spread})
    sonar = Sonar(_caster("basin"), usual.pattern(), model, np.random.default_rng(seed))
    strengths = sonar.pings(np.repeat(T_world_sonar[np.newaxis], len(angles), axis=0), angles)
    assembler = ScanAssembler(parameters)
    for number, angle in enumerate(angles):
        stamp_ns = 10**12 + round(1e9 * head.time(number))
        beam = parameters.corrected(Beam(stamp_ns, "sonar", float(angle), strengths[number], sonar.range_resolution))
        scan = assembler.add(PlacedBeam(beam, T_world_sonar, is_moving=False))
    return scan


@lru_cache(maxsize=None)
def _caster(world: str) -> RayCaster:
    return RayCaster(WORLDS[world]())
