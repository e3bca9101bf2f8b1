"""Makes sonar beams from ray scans, with the simulator's echo models."""

import math
from dataclasses import dataclass

import numpy as np

from sonar_simulator.echoes.echo_model import EchoModel
from sonar_simulator.gazebo.rays import Rays
from sonar_simulator.rays.ray_grid import contacts_of_grid
from sonar_simulator.simulation.simulation import Ping
from sonar_simulator.simulation.sonar_head import SonarHead


@dataclass(frozen=True)
class RayScan:
    """One scan of a ray sensor: its rays, its stamp in ns and its frame."""

    rays: Rays
    stamp_ns: int
    frame_id: str


class GazeboBeams:
    """Makes beams from what the rays hit. The same seed and scans give the same beams."""

    def __init__(self, model: EchoModel, seed: int) -> None:
        self._model = model
        self._rng = np.random.default_rng(seed)

    @property
    def max_range(self) -> float:
        """Far end of the last bin, m."""
        return self._model.max_range

    def turned(self, scan: RayScan, T_sonar_rays: np.ndarray) -> Ping:
        """Return the beam of a sensor that has turned to the (4, 4) pose; all its rays belong to the beam."""
        return self._ping(math.atan2(T_sonar_rays[1, 0], T_sonar_rays[0, 0]), scan.rays)

    def swept(self, scan: RayScan, head: SonarHead, beam: int, opening: float) -> Ping:
        """Return beam number `beam`, `opening` rad wide, of a sensor that sees the whole circle.

        Raises RefusedInput if there is no ray within it.
        """
        angle = head.angle(beam)
        return self._ping(angle, scan.rays.within(angle, opening))

    def _ping(self, angle: float, rays: Rays) -> Ping:
        contacts = contacts_of_grid(rays.ranges, rays.elevations, rays.bearings, retro=rays.retro)
        return Ping(angle, self._model.echoes(contacts, self._rng)[0])
