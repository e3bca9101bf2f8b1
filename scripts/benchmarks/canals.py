"""How honest the joint solver is in straight canals, whose walls do not tell the way along them.

A vehicle with a compass alone goes from one basin through a canal, 200 m long and 20 m wide, into another basin.
"""

from itertools import product
from typing import Iterator, Tuple

import numpy as np

from benchmarks.harness import placed
from benchmarks.paths import judged, replay_input
from benchmarks.twin_conditions import TwinParameters, lasting, reported
from benchmarks.twin_water import RESOLUTION, Water, heard, water_of
from mlsm_manager.joint_solver.live_solver import LiveSolver
from mlsm_manager.joint_solver.run_log import RunLog
from mlsm_manager.localisation.odometry_profiles import OdometryKind
from mlsm_manager.offline.recording import Recording
from mlsm_manager.scan_matching.scan import Track
from sonar_processing.beams.beam import Beam

LENGTH, WIDTH = 200.0, 20.0  # m of the canal, which goes along +x from x = 0
_BASIN = np.array([70.0, 60.0])  # m, length and width of each basin
_MARGIN = 5.0  # m of land around the water
_SHORE, _WALL = (3.0, 5.0), (0.15, 1.0)  # m, relief and its length: of the basins' shores, and of sheet piles
_POST, _BESIDE = 0.4, 8.0  # m: radius of a post, and its distance from the canal's axis
_WAYPOINTS = ((-35, 12), (-55, 0), (-35, -12), (-15, 0), (-35, 12), (-55, 0), (-35, -8), (-8, 0), (100, 0), (230, 0))
_STEP, _NEAR, _TURN_RATE = 0.1, 3.0, 0.1  # s between poses; m from a waypoint where the next one counts; rad/s
_SPEED, _SPEED_NOISE, _SPEED_TIME = 0.28, 0.05, 40.0  # m/s, m/s, s: of the recorded vehicle
_WEAVE, _WEAVE_TIME = 0.25, 7.0  # rad, s: by which the recorded vehicle leaves its course
_BEAM_SECONDS, _BEAM_ANGLE, _BIN = 0.069, np.radians(1.8), 0.1  # of the recorded head: a turn in 13.8 s
_START_NS = 10**12


def _made_canal(posts: int, rng: np.random.RandomState) -> Water:
    """Return two basins with a canal between them, and `posts` posts along its walls."""
    origin = np.array([-_BASIN[0], -_BASIN[1] / 2.0]) - _MARGIN
    size = np.array([LENGTH + 2.0 * _BASIN[0], _BASIN[1]]) + 2.0 * _MARGIN
    x, y = (np.arange(0.0, extent, RESOLUTION) + start for extent, start in zip(size, origin))
    shore, wall = (height * lasting(rng, np.full(len(x), RESOLUTION), length) for height, length in (_SHORE, _WALL))
    in_canal = (x > -1.0) & (x < LENGTH + 1.0)
    in_basins = (x > -_BASIN[0]) & (x < LENGTH + _BASIN[0]) & ((x < 0.0) | (x > LENGTH))
    half = np.maximum(np.where(in_canal, WIDTH / 2.0 + wall, 0.0), in_basins * (_BASIN[1] / 2.0 - np.abs(shore)))
    free = np.abs(y) < half[:, np.newaxis]
    for _ in range(posts):
        place = rng.uniform(10.0, LENGTH - 10.0), rng.choice([-_BESIDE, _BESIDE])
        free &= np.hypot(x[:, np.newaxis] - place[0], y - place[1]) > _POST
    return water_of(free, origin)


def _made_path(rng: np.random.RandomState) -> Track:
    """Return the path of a vehicle that goes ahead, from waypoint to waypoint, not quite straight."""
    left, poses = list(_WAYPOINTS), [np.array([-20.0, 8.0, 2.0])]
    count = 20000
    speeds = _SPEED + _SPEED_NOISE * lasting(rng, np.full(count, _STEP), _SPEED_TIME)
    weave = _WEAVE * lasting(rng, np.full(count, _STEP), _WEAVE_TIME)
    for speed, aside in zip(speeds, weave):
        x, y, yaw = poses[-1]
        if np.hypot(left[0][0] - x, left[0][1] - y) < _NEAR:
            left.pop(0)
        if not left:
            break
        turn = np.angle(np.exp(1j * (np.arctan2(left[0][1] - y, left[0][0] - x) + aside - yaw)))
        yaw += np.clip(turn, -_TURN_RATE * _STEP, _TURN_RATE * _STEP)
        poses.append(np.array([x + speed * _STEP * np.cos(yaw), y + speed * _STEP * np.sin(yaw), yaw]))
    return Track(_START_NS * 1e-9 + _STEP * np.arange(len(poses)), np.array(poses))


def _recorded_along(truth: Track, water: Water, rng: np.random.RandomState) -> Recording:
    """Return what a vehicle with a compass and a scanning sonar records along a path."""
    conditions = TwinParameters(range_scale=0.0, delay=0.0)
    stamps = np.arange(truth.times[0], truth.times[-1] - 2.0, _BEAM_SECONDS)
    bearings = np.angle(np.exp(1j * _BEAM_ANGLE * np.arange(len(stamps))))
    strengths = heard(water, truth.at(stamps), bearings, np.zeros(2), conditions, rng)
    track = Track(truth.times, reported(truth, conditions, rng).poses * [0.0, 0.0, 1.0])
    rows = zip(stamps, bearings, strengths)
    beams = [Beam(round(1e9 * time), "sonar", bearing, row, _BIN) for time, bearing, row in rows]
    return Recording(placed(beams, track, np.eye(4)), 0, track, None)


def lines(posts: Tuple[int, ...] = (0, 12), seeds: int = 3) -> Iterator[str]:
    """Yield the figures of the joint solver's live path from the canal on. posts: along it. seeds: runs with each."""
    for count, seed in product(posts, range(seeds)):
        rng = np.random.RandomState(seed)
        water, truth = _made_canal(count, rng), _made_path(rng)
        recording = _recorded_along(truth, water, rng)
        scans, parameters = replay_input(recording, OdometryKind.HEADING)
        solver = LiveSolver(parameters.solver_parameters(), RunLog(recording.sonar_in_base))
        for scan in scans:
            solver.add(scan)
        path = np.array([estimate.T_map_base[:2] for estimate in solver.estimates])
        covariances = np.array([estimate.pose_covariance[:2, :2] for estimate in solver.estimates])
        places = truth.at(solver.log.node_times)[:, :2]
        # Both paths begin at one place.
        aligned = places[1:] - places[0] + solver.log.node_poses(np.array([0]))[0, :2]
        chosen = places[1:, 0] > 0.0
        found = judged(path[chosen], aligned[chosen], covariances[chosen])
        yield (
            f"{count} posts, seed {seed}, from the canal on: {found.mean:.2f} m in the mean, {found.most:.2f} m at "
            f"most, shape {found.shape:.2f} m, NEES per state {found.nees:.2f}; stated deviation {found.stated:.2f} m, "
            f"{found.stated_most:.2f} m at most; within three of them {100.0 * found.within:.0f} %"
        )
