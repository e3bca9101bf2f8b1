"""How far off a path must be at least, whatever solver finds it: the Cramer-Rao bound of a simulated tour.

Each echo tells the distance of a surface along its normal, and of a post in both directions, as well as the echoes of
the tour are right. The odometry tells what a DVL and a compass do; scale of ranges and delay of beams are unknown as
they are to the solver. Which surface was heard is taken as known.
"""

from dataclasses import dataclass
from typing import Sequence

import numpy as np

from benchmarks.world_distance import distances, nearest_shape
from mlsm_manager.joint_solver.measured.odometry_timeline import OdometryTimeline
from mlsm_manager.joint_solver.measured.surface_points import points_per_echo
from mlsm_manager.joint_solver.motion.dvl_factors import DvlFactors
from mlsm_manager.joint_solver.motion.odometry_parameters import DvlOdometry
from mlsm_manager.joint_solver.parameters import SonarCalibration
from mlsm_manager.joint_solver.priors import add_belief, run_deviations, run_mean
from mlsm_manager.joint_solver.unknowns.normal_equations import NormalEquations, solution_of
from mlsm_manager.joint_solver.unknowns.state import POSE_COLUMNS, RUN_COLUMNS, Layout
from mlsm_manager.scan_matching.scan import Scan, Track
from node_support.geometry import inverse, transformed
from sonar_simulator.world.world import World

_HEARD = 1.5  # m from a surface within which an echo is one of it, and no speckle
_HALF_NORMAL = 0.6745  # median of the distance of a normal variable from its mean, in deviations
_INLIER = 3.0  # deviations
_POST = 0.6  # m: greatest radius of what is heard as one echo and can be met from all sides
_STEP = 0.05  # m for derivatives of distances
_BACK = 0.3  # m from the surface towards the sonar at which they are taken, beyond where distances bend
_SHAPE_DEVIATION = 10.0  # m, rad: of a shape of which nothing is known
_HELD = 1e-6  # m, rad: of one that is known
_HALF_SECOND = 0.5  # s: the velocity of a beam is averaged over one second


@dataclass(frozen=True)
class Echoes:
    """n echoes of scans, where they lie in the world by the true path, and the shapes that they are of.

    scans, shapes: (n,). points: (n, 3) m. arms: (n, 2) m from base_link. ranges: (n,) m. times: (n,) s. weights: (n,)
    shares of an echo. distances: (n,) m from the shapes.
    """

    scans: np.ndarray
    shapes: np.ndarray
    points: np.ndarray
    arms: np.ndarray
    times: np.ndarray
    weights: np.ndarray
    distances: np.ndarray

    @property
    def deviation(self) -> float:
        """Standard deviation [m] of the echoes from the surfaces, the few that are far off left out."""
        return float(np.median(self.distances[self.distances < _HEARD]) / _HALF_NORMAL)


def echoes_of(scans: Sequence[Scan], truth: Track, world: World) -> Echoes:
    """Return the echoes of all scans of a tour."""
    parts = []
    for number, scan in enumerate(scans):
        true, seen = truth.at(scan.times), transformed(inverse(scan.track.at(scan.times)), scan.points)
        points = transformed(true, seen)[:, :3]
        share = 1.0 / points_per_echo(scan.times, np.hypot(seen[:, 0], seen[:, 1]))
        arms = points[:, :2] - true[:, :2]
        parts.append((np.full(len(points), number), points, arms, scan.times, share))
    scan, points, arms, times, weights = (np.concatenate(part) for part in zip(*parts))
    return Echoes(scan, nearest_shape(world, points), points, arms, times, weights, distances(world, points))


@dataclass(frozen=True)
class Bounds:
    """Deviations [m] of the path at the scans' ends, medians along the tour.

    known: with the map known beforehand. unknown: without. shape: without, of the path once it is shifted, turned and
    scaled to where it fits best: only a compass, an odometry and a speed of sound that are right tell these.
    """

    known: float
    unknown: float
    shape: float


def bounds(scans: Sequence[Scan], truth: Track, world: World, head_step: float) -> Bounds:
    """Return how far off the path must be. head_step: rad between beams; an echo may be anywhere within."""
    ends = np.array([scan.reference_time for scan in scans])
    times = np.append(min(scans[0].start, ends[0] - 1.0), ends)
    heard = Heard.of(echoes_of(scans, truth, world), times, truth, world, head_step)
    unknown = _covariance(heard, times, truth, _SHAPE_DEVIATION)
    return Bounds(
        known=_median_deviation(_covariance(heard, times, truth, _HELD)),
        unknown=_median_deviation(unknown),
        shape=_median_deviation(_of_shape(unknown, truth.at(times)[1:, :2])),
    )


@dataclass(frozen=True)
class Heard:
    """What n echoes tell of the unknowns: distances along `directions` (n, 2), each with its weight (n,) [1/m^2].

    scans, shapes, shares, weights: (n,). levers, sights, centred: (n, 2) m, by which the nodes' yaw, the range scale
    and the shape's yaw move a point. velocities: (n, 2) m/s, by which the delay does. shape_count: of the world.
    """

    scans: np.ndarray
    shapes: np.ndarray
    shares: np.ndarray
    weights: np.ndarray
    directions: np.ndarray
    levers: np.ndarray
    sights: np.ndarray
    centred: np.ndarray
    velocities: np.ndarray
    shape_count: int

    @classmethod
    def of(cls, echoes: Echoes, times: np.ndarray, truth: Track, world: World, head_step: float) -> "Heard":
        """times: (m,) s of the nodes. Echoes of posts are met in two directions, along and across the sight."""
        near = np.flatnonzero(echoes.distances < min(_INLIER * echoes.deviation, _HEARD))
        posts = np.array([shape.kind != "box" and shape.size[0] <= _POST for shape in world.shapes])
        arms = echoes.arms[near]
        sight = arms / np.maximum(np.hypot(*arms.T), 1e-9)[:, np.newaxis]
        across = np.column_stack([-sight[:, 1], sight[:, 0]])
        of_post = posts[echoes.shapes[near]]
        normals = np.where(of_post[:, np.newaxis], sight, _normals(world, echoes.points[near], sight))
        kept = np.concatenate([np.arange(len(near)), np.flatnonzero(of_post)])
        rows, directions = near[kept], np.concatenate([normals, across[of_post]])
        slants = np.abs(np.einsum("na,na->n", directions, across[kept])) * np.hypot(*arms[kept].T)
        variances = echoes.deviation**2 + (head_step / np.sqrt(12.0) * slants) ** 2
        scans, points = echoes.scans[rows], echoes.points[rows, :2]
        shares = (echoes.times[rows] - times[scans]) / np.diff(times)[scans]
        centers = np.array([shape.pose[:2, 3] for shape in world.shapes])[echoes.shapes[rows]]
        return cls(
            scans=scans, shapes=echoes.shapes[rows], shares=shares, weights=echoes.weights[rows] / variances,
            directions=directions, levers=points - on_chords(truth.at(times)[:, :2], scans, shares),
            sights=arms[kept], centred=points - centers,
            velocities=_beam_velocities(truth, echoes.times[rows], arms[kept]), shape_count=len(world.shapes),
        )  # fmt: skip

    def add_to(self, equations: NormalEquations, layout: Layout) -> None:
        """Add what the echoes tell; the shapes' unknowns (x, y, yaw) stand after those of the run."""
        by_pose = np.column_stack([self.directions, _lever(self.levers, self.directions)])
        by_shape = -np.column_stack([self.directions, _lever(self.centred, self.directions)])
        by_run = np.column_stack(
            [np.einsum("na,na->n", some, self.directions) for some in (self.sights, self.velocities)]
        )
        share = self.shares[:, np.newaxis]
        columns = np.column_stack(
            [
                layout.pose_columns(self.scans),
                layout.pose_columns(self.scans + 1),
                np.broadcast_to(layout.run_start + np.arange(RUN_COLUMNS), (len(self.scans), RUN_COLUMNS)),
                layout.size + POSE_COLUMNS * self.shapes[:, np.newaxis] + np.arange(POSE_COLUMNS),
            ]
        )
        jacobian = np.column_stack([(1.0 - share) * by_pose, share * by_pose, by_run, by_shape])
        equations.add(columns, jacobian, np.zeros(len(self.scans)), self.weights)


def _covariance(heard: Heard, times: np.ndarray, truth: Track, shape_deviation: float) -> np.ndarray:
    """Return (2 n, 2 n) [m^2] of the places at all `times` but the first."""
    odometry, sonar = DvlFactors(DvlOdometry()), SonarCalibration()
    layout = Layout(0, len(times) - 1, odometry.width)
    shapes = POSE_COLUMNS * heard.shape_count
    equations = NormalEquations(layout.size + shapes)
    nodes = np.zeros((len(times), odometry.width))
    add_belief(equations, 0, nodes[0], nodes[0], odometry.first_deviations())
    odometry.add_steps(equations, layout, nodes, OdometryTimeline.of(truth).motion(times))
    add_belief(equations, layout.run_start, run_mean(sonar), run_mean(sonar), run_deviations(sonar))
    add_belief(equations, layout.size, np.zeros(shapes), np.zeros(shapes), np.full(shapes, shape_deviation))
    heard.add_to(equations, layout)
    places = layout.pose_columns(np.arange(1, len(times)))[:, :2].ravel()
    unit = np.zeros((layout.size + shapes, len(places)))
    unit[places, np.arange(len(places))] = 1.0
    return solution_of(equations).solve(unit)[places]


def _of_shape(covariance: np.ndarray, places: np.ndarray) -> np.ndarray:
    """Return the covariance (2 n, 2 n) of places (n, 2) once these are shifted, turned and scaled to fit best."""
    offset = places - places.mean(axis=0)
    turned = np.column_stack([-offset[:, 1], offset[:, 0]])
    shifts = np.tile(np.eye(2), (len(places), 1))
    modes, _ = np.linalg.qr(np.column_stack([shifts, offset.ravel(), turned.ravel()]))
    left = np.eye(len(covariance)) - modes @ modes.T
    return left @ covariance @ left


def _median_deviation(covariance: np.ndarray) -> float:
    return float(np.median(np.sqrt(np.diag(covariance).reshape(-1, 2).sum(axis=1))))


def _beam_velocities(truth: Track, times: np.ndarray, arms: np.ndarray) -> np.ndarray:
    """Return by how much (n, 2) [m/s] points at `arms` (n, 2) from the vehicle move with its beams."""
    change = (truth.at(times + _HALF_SECOND) - truth.at(times - _HALF_SECOND)) / (2.0 * _HALF_SECOND)
    return change[:, :2] + change[:, 2:] * np.column_stack([-arms[:, 1], arms[:, 0]])


def on_chords(places: np.ndarray, legs: np.ndarray, share: np.ndarray) -> np.ndarray:
    """Return places (n, 2) on the straight lines between nodes at `places` (m, 2).

    Nodes that all turn about one point turn what lies between them about it too, however bent the path is: else a
    bent path would seem to tell where north is.
    """
    share = share[:, np.newaxis]
    return (1.0 - share) * places[legs] + share * places[legs + 1]


def _lever(arms: np.ndarray, directions: np.ndarray) -> np.ndarray:
    return arms[:, 0] * directions[:, 1] - arms[:, 1] * directions[:, 0]


def _normals(world: World, points: np.ndarray, sight: np.ndarray) -> np.ndarray:
    """Return the horizontal directions (n, 2) along which the distances from the world change."""
    before = points.copy()
    before[:, :2] -= _BACK * sight
    slopes = np.zeros((len(points), 2))
    for axis in (0, 1):
        step = _STEP * np.eye(3)[axis]
        slopes[:, axis] = distances(world, before + step) - distances(world, before - step)
    return slopes / np.maximum(np.hypot(*slopes.T), 1e-9)[:, np.newaxis]
