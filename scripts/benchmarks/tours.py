"""Simulated tours: what the sonar hears on them, and recordings of them with an odometry of one's choice."""

from typing import List, NamedTuple

import numpy as np
import yaml

from benchmarks.harness import ROOT, placed
from benchmarks.scans import KINDS, RAYS, SonarKind
from benchmarks.twin_conditions import TwinParameters, reported
from mlsm_manager.offline.recording import Recording, Truth
from mlsm_manager.scan_matching.scan import Track
from sonar_processing.beams.beam import Beam
from sonar_simulator.simulation.robot import RobotDescription
from sonar_simulator.simulation.simulation import Settings, Simulation

HEAD = KINDS[0]  # the demo's
_START = 1000.0  # s
_MOUNTING, _SCALE = 0.105, 0.01  # rad, relative: deviations of a mounting angle set by eye, and of a DVL's scale
_STEP = 0.1  # s between poses of the odometry


class Tour(NamedTuple):
    """A tour without any odometry. truth: the vehicle's path. T_base_sonar: (4, 4)."""

    truth: Track
    beams: List[Beam]
    T_base_sonar: np.ndarray

    def recording(self, odometry: Track) -> Recording:
        """Return the recording with an odometry."""
        beams = placed(self.beams, odometry, self.T_base_sonar)
        return Recording(beams, 0, odometry, Truth(self.truth.times, self.truth.poses[:, :2]))

    def scaled(self, error: float) -> Recording:
        """Return the recording with an odometry of which true distances are 1 + `error` times what it reports."""
        start = np.append(self.truth.poses[0, :2], 0.0)
        factors = np.array([1.0 / (1.0 + error), 1.0 / (1.0 + error), 1.0])
        return self.recording(Track(self.truth.times, (self.truth.poses - start) * factors + start))

    def with_dvl(self, seed: int, **errors: float) -> Recording:
        """Return the recording with errors of a DVL and a compass, drawn at random; `errors`: see TwinParameters."""
        rng = np.random.RandomState(seed)
        usual = {"direction": rng.normal(0.0, _MOUNTING), "scale": rng.normal(0.0, _SCALE)}
        made = reported(self.truth, TwinParameters(**{**usual, **errors}), rng)
        return self.recording(Track(made.times, made.poses + np.append(self.truth.poses[0, :2], 0.0)))


def simulated(name: str, kind: SonarKind = HEAD, seed: int = 1) -> Tour:
    """Return what a sonar hears on the tour yaml/`name`.yaml in the world that the name begins with."""
    values = yaml.safe_load((ROOT / "yaml/sonar_simulator_demo.yaml").read_text())
    rows, columns = RAYS[kind.rays]
    values.update(
        laser_cone={"spread": kind.spread}, sonar={"ray_rows": rows, "ray_columns": columns},
        world=f"worlds/{name.split('_')[0]}.sdf", script=f"yaml/{name}.yaml", odometry={"scale_error": 0.0}, seed=seed,
    )  # fmt: skip
    robot = RobotDescription.from_file(ROOT / "urdf/charle.urdf")
    simulation = Simulation(Settings.from_mapping(values), ROOT, robot, lambda warning: None)
    times, poses, beams = [], [], []
    for moment in simulation.moments(20.0, 120):
        time, pose = _START + moment.time, moment.truth.T_world_base
        if not times or time > times[-1]:
            times.append(time)
            poses.append([pose[0, 3], pose[1, 3], np.arctan2(pose[1, 0], pose[0, 0])])
        if moment.ping is not None:
            ping, resolution = moment.ping, simulation.sonar.range_resolution
            beams.append(Beam(round(1e9 * time), "sonar", ping.angle, ping.strengths, resolution))
    path, steps = Track(np.array(times), np.array(poses)), np.arange(times[0], times[-1], _STEP)
    return Tour(Track(steps, path.at(steps)), beams, simulation.T_base_sonar)
