"""Scans of a simulated tour, made without a master as the graph would make them."""

from dataclasses import dataclass
from pathlib import Path
from typing import Dict, Iterator, List, Tuple

import numpy as np
import yaml

from sonar_processing.beams.beam import Beam
from sonar_processing.beams.placed_beam import PlacedBeam
from sonar_processing.cloud import IntensityCloud
from sonar_processing.scans.assembler import ScanAssembler
from sonar_processing.scans.parameters import SonarToCloudParameters
from sonar_simulator.simulation.simulation import Moment
from sonar_simulator.simulation.simulation_setup import Settings, Setup, make_setup
from sonar_simulator.vehicle.robot_description import RobotDescription
from sonar_simulator.vehicle.servo import tilted

ROOT = Path(__file__).resolve().parents[2]
START_NS = 10**12
BEAMS_AT_ONCE = 120


@dataclass(frozen=True)
class TourScan:
    """One scan in odom, which is the world here; times (m,) [s] of its beams and places (m, 2) x y [m] of the sonar."""

    cloud: IntensityCloud
    times: np.ndarray
    places: np.ndarray

    def sonar_positions(self, times: np.ndarray) -> np.ndarray:
        """Return (n, 2) where the sonar was at the times (n,) [s] of beams."""
        return self.places[np.abs(self.times[np.newaxis] - times[:, np.newaxis]).argmin(axis=1)]


def tour_setup(world: str, tour: str, seed: int) -> Tuple[Settings, Setup]:
    """Return the simulation of yaml/`world`_`tour`.yaml with the demo's sonar and an odometry without error."""
    demo = ROOT / "yaml" / f"sonar_simulator_{'tank' if world == 'tank' else 'demo'}.yaml"
    values: Dict[str, object] = yaml.safe_load(demo.read_text())
    values.update(world=f"worlds/{world}.sdf", script=f"yaml/{world}_{tour}.yaml", seed=seed)
    settings = Settings.from_mapping({**values, "odometry": {"scale_error": 0.0}})
    robot = RobotDescription.from_file(ROOT / "urdf/charle.urdf")
    return settings, make_setup(settings, ROOT, robot, lambda warning: None)


def tour_scans(settings: Settings, setup: Setup) -> Iterator[TourScan]:
    """Yield the scans of a whole tour, oldest first."""
    assembler = ScanAssembler(SonarToCloudParameters())
    beams: List[Tuple[float, np.ndarray]] = []
    for moment in setup.simulation.moments(settings.simulator.clock_rate, BEAMS_AT_ONCE):
        if moment.ping is None:
            continue
        placed = _placed(moment, setup)
        beams.append((placed.beam.stamp_ns * 1e-9, placed.T_target_sonar[:2, 3]))
        cloud = assembler.add(placed)
        if cloud is not None:
            yield TourScan(cloud, np.array([time for time, _ in beams]), np.array([place for _, place in beams]))
            beams = []


def _placed(moment: Moment, setup: Setup) -> PlacedBeam:
    assert moment.ping is not None
    stamp_ns = START_NS + round(1e9 * moment.time)
    beam = Beam(stamp_ns, "sonar", moment.ping.angle, moment.ping.strengths, setup.sonar.range_resolution)
    T_odom_sonar = moment.odometry.T_odom_base @ tilted(setup.T_base_sonar, moment.tilt)
    return PlacedBeam(beam, T_odom_sonar, not moment.truth.is_still)
