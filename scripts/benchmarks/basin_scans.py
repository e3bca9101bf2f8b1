"""Still scans of the basin, simulated without a master: what the detectors see from known places."""

import math
from pathlib import Path

import numpy as np

from node_support.geometry import pose_matrix
from sonar_processing.beams.beam import Beam
from sonar_processing.beams.placed_beam import PlacedBeam
from sonar_processing.cloud import IntensityCloud
from sonar_processing.scans.assembler import ScanAssembler
from sonar_processing.scans.parameters import SonarToCloudParameters
from sonar_simulator.echoes.echo_model import make_echo_model
from sonar_simulator.rays.ray_caster import RayCaster
from sonar_simulator.simulation.sonar_head import Sonar, SonarHead, SonarParameters
from sonar_simulator.world.sdf import load_sdf

ROOT = Path(__file__).resolve().parents[2]
HALF_LENGTH, HALF_WIDTH = 60.0, 25.0
WALLS = ((1.0, 0.0, HALF_LENGTH), (-1.0, 0.0, HALF_LENGTH), (0.0, 1.0, HALF_WIDTH), (0.0, -1.0, HALF_WIDTH))
"""Inner faces: normal x, normal y, distance from the basin's centre [m]."""
BUOYS = ((42.0, 17.0), (-50.0, -16.0))
SONAR_DEPTH = 1.8


class BasinScans:
    """Scans of 120 beams and 50 m with one spread of the echoes [m]."""

    def __init__(self, spread: float) -> None:
        self._caster = RayCaster(load_sdf(ROOT / "worlds/basin.sdf").world)
        self._parameters = SonarParameters()
        self._model = make_echo_model("laser_cone", {"spread": spread})

    def scan(self, T_world_sonar: np.ndarray, seed: int) -> IntensityCloud:
        """Return the full turn heard from a (4, 4) pose, organised, in the world frame."""
        head = SonarHead(self._parameters.beams_per_turn, self._parameters.seconds_per_turn)
        angles = np.array([head.angle(beam) for beam in range(head.beams_per_turn)])
        sonar = Sonar(self._caster, self._parameters.pattern(), self._model, np.random.default_rng(seed))
        strengths = sonar.pings(np.repeat(T_world_sonar[np.newaxis], len(angles), axis=0), angles)
        assembler = ScanAssembler(SonarToCloudParameters(keep_organized=True))
        scans = []
        for number, angle in enumerate(angles):
            stamp_ns = 10**12 + round(1e9 * head.time(number))
            beam = Beam(stamp_ns, "sonar", float(angle), strengths[number], sonar.range_resolution)
            scans.append(assembler.add(PlacedBeam(beam, T_world_sonar, is_moving=False)))
        return next(scan for scan in scans if scan is not None)


def anywhere(seed: int) -> np.ndarray:
    """Return the (4, 4) pose of a sonar somewhere in the basin, 7 m or more from its walls."""
    rng = np.random.default_rng([1, seed])
    return _pose(rng.uniform(-50.0, 50.0), rng.uniform(-18.0, 18.0), rng)


def near_buoy(seed: int, distance: float = 10.0) -> np.ndarray:
    """Return the (4, 4) pose of a sonar `distance` m from the axis of buoy number seed mod 2, any way round."""
    rng = np.random.default_rng([2, seed])
    buoy = BUOYS[seed % len(BUOYS)]
    while True:
        bearing = rng.uniform(-math.pi, math.pi)
        x, y = buoy[0] + distance * math.cos(bearing), buoy[1] + distance * math.sin(bearing)
        if abs(x) < HALF_LENGTH - 3.0 and abs(y) < HALF_WIDTH - 3.0:
            return _pose(x, y, rng)


def _pose(x: float, y: float, rng: np.random.Generator) -> np.ndarray:
    return pose_matrix((x, y, -SONAR_DEPTH), (0.0, 0.0, rng.uniform(-math.pi, math.pi)))
