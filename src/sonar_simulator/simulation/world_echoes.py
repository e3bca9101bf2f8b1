"""Echoes from a world file for an emulated head, which needs one ping at a time (thesis 6.4)."""

import math
from typing import Callable, Optional, Protocol

import numpy as np

from node_support.geometry import pose_matrix
from node_support.parameters import ParameterError
from sonar_simulator.echoes.laser_cone import LaserCone, LaserConeParameters
from sonar_simulator.rays.beam_pattern import BeamPattern
from sonar_simulator.rays.ray_caster import RayCaster
from sonar_simulator.simulation.sonar_head import Sonar, SonarParameters
from sonar_simulator.world.errors import WorldError
from sonar_simulator.world.world import World
from sonar_simulator.world.world_file import load_world


class PingRequest(Protocol):
    """One ping of an emulated head: angle in rad, counter-clockwise, range in m, gain above the usual in dB."""

    angle: float
    bin_count: int
    max_range: float
    gain_db: float


class HeadInWorld(Protocol):
    """The world, the position and heading of the head in it, and its beam: m, degrees counter-clockwise."""

    world_file: str
    x: float
    y: float
    z: float
    yaw_deg: float
    beam_height_deg: float
    beam_width_deg: float
    seed: int


Place = Callable[[], Optional[np.ndarray]]
"""Returns the (4, 4) T_world_sonar of now; None where it is not known."""

_SPREAD = 0.15  # m: the length of a real head's usual pulse of 100 us
DEFAULT_SONAR = SonarParameters()


class WorldEchoes:
    """Answers pings with what a head hears in a world; the gain scales the strengths."""

    def __init__(self, world: World, place: Place, seed: int, sonar: SonarParameters = DEFAULT_SONAR) -> None:
        """Raises MissingPackageError when the ray caster is not installed."""
        self._caster = RayCaster(world)
        self._place = place
        self._pattern: BeamPattern = sonar.pattern()
        self._rng = np.random.default_rng(seed)

    def echoes(self, ping: PingRequest) -> bytes:
        """Return `ping.bin_count` echo strengths (0 to 255), nearest bin first; none are heard without a place."""
        pose = self._place()
        if pose is None:
            return bytes(ping.bin_count)
        model = LaserCone(LaserConeParameters(bins=ping.bin_count, max_range=ping.max_range, spread=_SPREAD))
        sonar = Sonar(self._caster, self._pattern, model, self._rng)
        factor = 10 ** (ping.gain_db / 20)
        strengths = sonar.ping(pose, ping.angle) * factor
        return np.minimum(np.rint(strengths), 255).astype(np.uint8).tobytes()


def world_echoes(parameters: HeadInWorld, place: Optional[Place] = None) -> WorldEchoes:
    """Load the world; raises ParameterError when the file cannot be used.

    place: of a head that moves; without it the head stands still, upright, where the parameters say.
    """
    position = parameters.x, parameters.y, parameters.z
    pose = pose_matrix(position, (0.0, 0.0, math.radians(parameters.yaw_deg)))
    sonar = SonarParameters(
        vertical_opening_deg=parameters.beam_height_deg, horizontal_opening_deg=parameters.beam_width_deg
    )
    try:
        return WorldEchoes(load_world(parameters.world_file).world, place or (lambda: pose), parameters.seed, sonar)
    except WorldError as error:
        raise ParameterError(f"world_file: {error}") from error
