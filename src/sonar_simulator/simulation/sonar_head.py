"""The sonar head: its beam and timing, what it hears in a world, and answers to the pings of emulated heads."""

import math
from dataclasses import dataclass
from typing import Callable, Optional

import numpy as np

from node_support.geometry import pose_matrix
from node_support.parameters import ParameterError, ParameterSet, parameter
from sonar_driver.emulated_head import EmulatedHeadParameters, PingRequest
from sonar_simulator.echoes.beam_tracer import BeamPattern, BeamTracer
from sonar_simulator.echoes.echo_model import EchoModel
from sonar_simulator.echoes.ray_caster import RayCaster
from sonar_simulator.echoes.thesis_models import LaserCone, LaserConeParameters
from sonar_simulator.world.world import World, WorldError
from sonar_simulator.world.world_file import load_world

# Beams per batch: large enough for numpy to be efficient, small enough for the processor's cache.
_BATCH = 120


@dataclass(frozen=True)
class SonarParameters(ParameterSet):
    """The head's timing and the shape of its beam."""

    beams_per_turn: int = parameter(
        120, "beams per revolution", low=1, high=3600, thesis_name="step = 360 / beams_per_turn", tunable=False
    )
    seconds_per_turn: float = parameter(16.0, "time of a revolution", unit="s", low=0.01, high=3600.0, tunable=False)
    vertical_opening_deg: float = parameter(
        22.0, "height of the beam", unit="deg", low=0.0, high=150.0, thesis_name="opening"
    )
    horizontal_opening_deg: float = parameter(2.5, "width of the beam", unit="deg", low=0.0, high=150.0)
    ray_rows: int = parameter(50, "rays over the height of a beam", low=1, high=1000)
    ray_columns: int = parameter(10, "rays over the width of a beam", low=1, high=1000)

    def pattern(self) -> BeamPattern:
        openings = math.radians(self.vertical_opening_deg), math.radians(self.horizontal_opening_deg)
        return BeamPattern(*openings, self.ray_rows, self.ray_columns)


@dataclass(frozen=True)
class SonarHead:
    """A head that turns counter-clockwise in equal steps and never stops; beam 0 points along +x at time 0."""

    beams_per_turn: int
    seconds_per_turn: float

    def angle(self, beam: int) -> float:
        """Return the head angle of beam number `beam`, rad in (-pi, pi] about the sonar's +z from +x."""
        step = beam % self.beams_per_turn
        if 2 * step > self.beams_per_turn:
            step -= self.beams_per_turn
        return math.pi * (2 * step / self.beams_per_turn)

    def time(self, beam: int) -> float:
        """Return when beam number `beam` is sent, s since beam 0."""
        return beam * self.seconds_per_turn / self.beams_per_turn


class Sonar:
    """Simulates beams in a world. The same seed and calls give the same bytes.

    Batches draw random numbers in a different order.
    """

    def __init__(self, caster: RayCaster, pattern: BeamPattern, model: EchoModel, rng: np.random.Generator) -> None:
        self._tracer = BeamTracer(caster, model.pattern(pattern), model.mirrors)
        self._model = model
        self._rng = rng

    @property
    def max_range(self) -> float:
        """Far end of the last bin, m."""
        return self._model.max_range

    @property
    def range_resolution(self) -> float:
        """Length of a bin, m."""
        return self._model.max_range / self._model.bins

    def ping(self, T_world_sonar: np.ndarray, angle: float) -> np.ndarray:
        """Return the strengths (bins,) uint8 of one beam at head `angle` rad from the (4, 4) pose."""
        return self.pings(T_world_sonar[np.newaxis], np.array([angle]))[0]

    def pings(self, T_world_sonar: np.ndarray, angles: np.ndarray) -> np.ndarray:
        """Return the strengths (beams, bins) uint8 at head `angles` (beams,) rad from poses (beams, 4, 4).

        Any number of beams is allowed: they are processed in batches that fit into memory.
        """
        batches = [np.empty((0, self._model.bins), dtype=np.uint8)]
        for start in range(0, len(angles), _BATCH):
            poses, turns = T_world_sonar[start : start + _BATCH], angles[start : start + _BATCH]
            contacts = self._tracer.contacts(poses, turns, self._model.max_range, self._rng)
            batches.append(self._model.echoes(contacts, self._rng))
        return np.concatenate(batches)


_SPREAD = 0.15  # m: the length of a real head's usual pulse of 100 us
Place = Callable[[], Optional[np.ndarray]]
"""Returns the (4, 4) T_world_sonar of now; None where it is not known."""
DEFAULT_SONAR = SonarParameters()


class WorldEchoes:
    """Answers pings with what a head hears in a world; the gain scales the strengths."""

    def __init__(self, world: World, place: Place, seed: int, sonar: SonarParameters = DEFAULT_SONAR) -> None:
        """Raises MissingPackageError when the ray caster is not installed."""
        self._caster = RayCaster(world)
        self._place = place
        self._pattern = sonar.pattern()
        self._rng = np.random.default_rng(seed)

    def __call__(self, ping: PingRequest) -> bytes:
        """Return `ping.bin_count` echo strengths (0 to 255), nearest bin first; none are heard without a place."""
        pose = self._place()
        if pose is None:
            return bytes(ping.bin_count)
        model = LaserCone(LaserConeParameters(bins=ping.bin_count, max_range=ping.max_range, spread=_SPREAD))
        sonar = Sonar(self._caster, self._pattern, model, self._rng)
        strengths = sonar.ping(pose, ping.angle) * 10 ** (ping.gain_db / 20)
        return np.minimum(np.rint(strengths), 255).astype(np.uint8).tobytes()


def world_echoes(parameters: EmulatedHeadParameters, place: Optional[Place] = None) -> WorldEchoes:
    """Load the world; raises ParameterError when the file cannot be used.

    place: of a head that moves; without it the head stands still, upright, where the parameters say.
    """
    position = parameters.x, parameters.y, parameters.z
    pose = pose_matrix(position, (0.0, 0.0, math.radians(parameters.yaw_deg)))
    sonar = SonarParameters(
        vertical_opening_deg=parameters.beam_height_deg, horizontal_opening_deg=parameters.beam_width_deg
    )
    try:
        return WorldEchoes(load_world(parameters.world_file), place or (lambda: pose), parameters.seed, sonar)
    except WorldError as error:
        raise ParameterError(f"world_file: {error}") from error
