"""How far off a path must be at least, whatever solver finds it: the Cramer-Rao bound of a simulated tour.

Each echo tells the distance of a surface along its normal, and of a post in both directions, as well as the echoes of
the tour are right. The odometry tells what a DVL and a compass do. Which surface was heard is taken as known.
"""

from dataclasses import dataclass
from typing import Sequence, Tuple

import numpy as np

from benchmarks.world_distance import distances, nearest_shape
from mlsm_manager.matching.problem.scan import Scan, Track
from mlsm_manager.multi_view.dvl_factors import DvlFactors
from mlsm_manager.multi_view.normal_equations import NormalEquations, solution_of
from mlsm_manager.multi_view.odometry_parameters import DvlOdometry
from mlsm_manager.multi_view.odometry_timeline import OdometryTimeline
from mlsm_manager.multi_view.priors import add_belief
from mlsm_manager.multi_view.state import POSE_COLUMNS, Layout
from mlsm_manager.multi_view.surface_points import points_per_echo
from node_support.geometry.planar import inverse, transformed
from sonar_simulator.world.world import World

_HEARD = 1.5  # m from a surface within which an echo is one of it, and no speckle
_HALF_NORMAL = 0.6745  # median of the distance of a normal variable from its mean, in deviations
_INLIER = 3.0  # deviations
_POST = 0.6  # m: greatest radius of what is heard as one echo and can be met from all sides
_STEP = 0.05  # m for derivatives of distances
_BACK = 0.3  # m from the surface towards the sonar at which they are taken, beyond where distances bend
_SHAPE_DEVIATION = 10.0  # m, rad: of a shape of which nothing is known


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


def bounds(scans: Sequence[Scan], truth: Track, world: World, head_step: float) -> Tuple[float, float]:
    """Return the median deviations [m] of the path at the scans' ends: with the map known beforehand, and without.

    head_step: rad between beams; an echo may be anywhere within.
    """
    echoes = echoes_of(scans, truth, world)
    ends = np.array([scan.reference_time for scan in scans])
    times = np.append(min(scans[0].start, ends[0] - 1.0), ends)
    return (
        _bound(echoes, times, truth, world, head_step, shape_deviation=1e-6),
        _bound(echoes, times, truth, world, head_step, shape_deviation=_SHAPE_DEVIATION),
    )


def _bound(
    echoes: Echoes, times: np.ndarray, truth: Track, world: World, head_step: float, shape_deviation: float
) -> float:
    odometry = DvlFactors(DvlOdometry())
    layout = Layout(0, len(times) - 1, odometry.width)
    size = layout.run_start + POSE_COLUMNS * len(world.shapes)
    equations = NormalEquations(size)
    nodes = np.zeros((len(times), odometry.width))
    timeline = OdometryTimeline.of(truth)
    add_belief(equations, 0, nodes[0], nodes[0], odometry.first_deviations())
    odometry.add_steps(equations, layout, nodes, timeline.motion(times))
    shapes = size - layout.run_start
    add_belief(equations, layout.run_start, np.zeros(shapes), np.zeros(shapes), np.full(shapes, shape_deviation))
    _add_echoes(equations, layout, echoes, times, world, head_step)
    solution = solution_of(equations)
    places = layout.pose_columns(np.arange(1, len(times)))[:, :2].ravel()
    unit = np.zeros((size, len(places)))
    unit[places, np.arange(len(places))] = 1.0
    variances = np.diag(solution.solve(unit)[places]).reshape(-1, 2)
    return float(np.median(np.sqrt(variances.sum(axis=1))))


def _add_echoes(
    equations: NormalEquations, layout: Layout, echoes: Echoes, times: np.ndarray, world: World, head_step: float
) -> None:
    known = np.flatnonzero(echoes.distances < min(_INLIER * echoes.deviation, _HEARD))
    arms, shapes = echoes.arms[known], echoes.shapes[known]
    centers = np.array([shape.pose[:2, 3] for shape in world.shapes])[shapes]
    sight = arms / np.maximum(np.hypot(*arms.T), 1e-9)[:, np.newaxis]
    across = np.column_stack([-sight[:, 1], sight[:, 0]])
    posts = np.array([shape.kind != "box" and shape.size[0] <= _POST for shape in world.shapes])[shapes]
    normals = np.where(posts[:, np.newaxis], sight, _normals(world, echoes.points[known], sight))
    own = echoes.deviation, head_step / np.sqrt(12.0) * np.hypot(*arms.T)
    columns = np.column_stack([layout.pose_columns(echoes.scans[known]), layout.pose_columns(echoes.scans[known] + 1)])
    columns = np.column_stack([columns, layout.run_start + POSE_COLUMNS * shapes[:, np.newaxis] + np.arange(3)])
    share = (echoes.times[known] - times[echoes.scans[known]]) / np.diff(times)[echoes.scans[known]]
    for direction, rows in ((normals, slice(None)), (across, posts)):
        slant = np.abs(np.einsum("na,na->n", direction, across)) * own[1]
        by_pose = np.column_stack([direction, _lever(arms, direction)])
        by_shape = -np.column_stack([direction, _lever(echoes.points[known, :2] - centers, direction)])
        jacobian = np.column_stack([(1.0 - share)[:, np.newaxis] * by_pose, share[:, np.newaxis] * by_pose, by_shape])
        weight = echoes.weights[known] / (own[0] ** 2 + slant**2)
        equations.add(columns[rows], jacobian[rows], np.zeros(len(known))[rows], weight[rows])


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
