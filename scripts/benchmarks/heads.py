"""Prints how far the joint solver's paths are from the truth, and how honest it is, with heads of different sharpness.

Each tour is simulated once per head. Its odometry is then drawn N times, with errors as those of a DVL and a compass.
Beside what the solver reaches stands how far off any solver must be (benchmarks.information_bound).
"""

from typing import List, NamedTuple, Tuple

import numpy as np
import yaml

from benchmarks.command_line import benchmark_parser
from benchmarks.information_bound import bounds
from benchmarks.matching_scans import KINDS, RAYS, SonarKind
from benchmarks.path_figures import PathFigures, figures_of
from benchmarks.tour_scans import BEAMS_AT_ONCE, ROOT, START_NS
from benchmarks.twins.odometry import reported
from benchmarks.twins.parameters import TwinParameters
from mlsm_manager.joint_solver.motion.odometry_parameters import DvlOdometry
from mlsm_manager.joint_solver.parameters import MultiViewParameters
from mlsm_manager.joint_solver.solve.batch_solver import solved
from mlsm_manager.joint_solver.solve.live_solver import LiveSolver
from mlsm_manager.offline.echo_length import echo_sigma
from mlsm_manager.offline.echo_shape import EchoShape, suited
from mlsm_manager.offline.recording import Recording, scans_of
from mlsm_manager.offline.replay_parameters import ReplayParameters
from mlsm_manager.scan_matching.scan import Scan, Track
from node_support.geometry import matrices, wrapped
from sonar_processing.beams.beam import Beam
from sonar_processing.beams.placed_beam import PlacedBeam
from sonar_simulator.simulation.simulation_setup import Settings, Setup, make_setup
from sonar_simulator.vehicle.robot_description import RobotDescription

_STEP = 0.1  # s between poses of the odometry


class Simulated(NamedTuple):
    """A tour without any odometry. truth: the vehicle's path. T_base_sonar: (4, 4)."""

    truth: Track
    beams: List[Beam]
    T_base_sonar: np.ndarray


def recordings(setup: Setup, draws: int) -> List[Tuple[Recording, Track]]:
    """Return recordings of one simulated tour, each with another odometry, and the true path of each."""
    tour = simulated(setup)
    return [(_drawn(tour, seed), tour.truth) for seed in range(draws)]


def simulated(setup: Setup) -> Simulated:
    """Return what is heard on a tour."""
    times, poses, beams = [], [], []
    for moment in setup.simulation.moments(20.0, BEAMS_AT_ONCE):
        time, pose = START_NS * 1e-9 + moment.time, moment.truth.T_world_base
        if not times or time > times[-1]:
            times.append(time)
            poses.append([pose[0, 3], pose[1, 3], np.arctan2(pose[1, 0], pose[0, 0])])
        if moment.ping is not None:
            stamp_ns = round(1e9 * time)
            beams.append(
                Beam(stamp_ns, "sonar", moment.ping.angle, moment.ping.strengths, setup.sonar.range_resolution)
            )
    path, steps = Track(np.array(times), np.array(poses)), np.arange(times[0], times[-1], _STEP)
    return Simulated(Track(steps, path.at(steps)), beams, setup.T_base_sonar)


def tour_setup(world: str, tour: str, kind: SonarKind) -> Setup:
    """Return the simulation of the tour yaml/`world`_`tour`.yaml."""
    values = yaml.safe_load((ROOT / "yaml/sonar_simulator_demo.yaml").read_text())
    rows, columns = RAYS[kind.rays]
    values.update(
        laser_cone={"spread": kind.spread}, sonar={"ray_rows": rows, "ray_columns": columns},
        world=f"worlds/{world}.sdf", script=f"yaml/{world}_{tour}.yaml", odometry={"scale_error": 0.0},
    )  # fmt: skip
    robot = RobotDescription.from_file(ROOT / "urdf/charle.urdf")
    return make_setup(Settings.from_mapping(values), ROOT, robot, lambda warning: None)


def _drawn(tour: Simulated, seed: int) -> Recording:
    """Return the recording with odometry errors drawn from what the solver expects of a DVL and a compass."""
    rng, expected = np.random.RandomState(seed), DvlOdometry()
    errors = TwinParameters(
        direction=rng.normal(0.0, expected.direction_deviation), scale=rng.normal(0.0, expected.scale_deviation)
    )
    made = reported(tour.truth, errors, rng)
    return recorded(tour, Track(made.times, made.poses + np.append(tour.truth.poses[0, :2], 0.0)))


def recorded(tour: Simulated, odometry: Track) -> Recording:
    """Return the recording of a tour with an odometry."""
    places = matrices(odometry.at(np.array([beam.stamp_ns for beam in tour.beams]) * 1e-9)) @ tour.T_base_sonar
    return Recording([PlacedBeam(beam, place, True) for beam, place in zip(tour.beams, places)], 0, odometry, None)


def figures(recording: Recording, truth: Track) -> Tuple[PathFigures, PathFigures]:
    """Return those of the live and of the batch solver."""
    solver = LiveSolver(MultiViewParameters(), recording.sonar_in_base)
    for scan in _scans(recording):
        solver.add(scan)
    return figures_of(solver, solved(solver), truth.at(solver.log.node_times)[:, :2])


def _scans(recording: Recording) -> List[Scan]:
    sigma = echo_sigma([placed.beam for placed in recording.beams])
    parameters = suited(ReplayParameters(), EchoShape.PEAK, (), sigma)
    return [scan for scan, _ in scans_of(recording, parameters.echoes())]


def _head_step(recording: Recording) -> float:
    """Return the angle between beams [rad]."""
    return float(np.median(np.abs(wrapped(np.diff([placed.beam.angle for placed in recording.beams])))))


def main() -> None:
    """Print one line per world and head."""
    parser = benchmark_parser("heads", __doc__)
    parser.add_argument("--worlds", nargs="+", default=["basin", "harbour"], choices=["basin", "harbour"])
    parser.add_argument("--draws", type=int, default=4, help="odometries per tour (default: %(default)s)")
    arguments = parser.parse_args()
    for world in arguments.worlds:
        for kind in KINDS:
            setup = tour_setup(world, "tour", kind)
            made = recordings(setup, arguments.draws)
            least = bounds(_scans(made[0][0]), made[0][1], setup.world, _head_step(made[0][0]))
            print(
                f"{world}, {kind}: bound {least.known:.2f} m with the map known, {least.unknown:.2f} m without, "
                f"{least.shape:.2f} m for the path's shape", flush=True,
            )  # fmt: skip
            means = np.mean([figures(*one) for one in made], axis=0)
            print("".join(f"    {name}: {PathFigures(*mean).line()}\n" for name, mean in zip(("live", "batch"), means)))


if __name__ == "__main__":
    main()
