"""Our matcher against the registrations of Open3D and small_gicp: the same scans, map and starts; time and error."""

import time
from importlib import import_module
from importlib.util import find_spec
from typing import Callable, Dict, List, NamedTuple

import numpy as np

from benchmarks.in_turn import OURS, ratio_figure
from benchmarks.matching_scans import KINDS, ScanMaker, still
from benchmarks.matching_starts import tour_map, tour_stops
from benchmarks.table import Row
from mlsm_manager.scan_matching.distribution_matcher import DistributionMatcher, DistributionMatcherParameters
from mlsm_manager.scan_matching.result import Prior
from mlsm_manager.scan_matching.scan import Scan
from mlsm_manager.surface_map.blocks import Blocks
from node_support.geometry import composed, inverse, matrices, wrapped

STARTS = 20
OFFSETS = ((1.0, 5.0), (3.0, 20.0))  # m and degrees between the expected and the true pose
MOST_TURNED = np.radians(3.0)
NEAR = 0.3  # m: a scan that lies this near to its place has found it
REACHES = (2.0, 4.0)  # m: of correspondences; the better one counts
MOST_ITERATIONS = 60
NEIGHBORS = 12  # Of a normal
_LEVELS = (-0.5, 0.0, 0.5)  # m: a level cloud has no upright normals, so it is told to be as high as this
_FIXED = 1e-3

Register = Callable[[Scan, Prior], np.ndarray]
"""Returns T_map_odom (3,) of a scan."""


class _Start(NamedTuple):
    scan: Scan
    prior: Prior
    pose: np.ndarray


def rows() -> List[Row]:
    """Compare all registrations that are installed, from near and from far."""
    maker = ScanMaker("basin", KINDS[0])
    ways = _registrations(tour_map(maker))
    compared = [row for distance, angle in OFFSETS for row in _offset_rows(maker, ways, distance, angle)]
    return compared + [(f"register a scan by {name}", "not measured: not installed", "") for name in _absent()]


def _offset_rows(maker: ScanMaker, ways: Dict[str, Register], distance: float, angle: float) -> List[Row]:
    starts = [_start(maker, seed, distance, np.radians(angle)) for seed in range(STARTS)]
    seconds, errors = {}, {}
    for name, register in ways.items():
        seconds[name], errors[name] = _measured(register, starts)
    title = f"register a scan in the basin from {distance:g} m and {angle:g} deg off"
    table = [(f"{title}: {OURS}", f"{1e3 * np.median(seconds[OURS]):.0f} ms of CPU; {_told(errors[OURS])}", "")]
    for name in _best_of_each(errors):
        figure, verdict = ratio_figure(seconds[name] / seconds[OURS])
        table.append((f"{title}: {name} over ours", f"{figure}; {_told(errors[name])}", f"{verdict} in time"))
    return table


def _start(maker: ScanMaker, seed: int, distance: float, angle: float) -> _Start:
    rng = np.random.default_rng(seed)
    stops = tour_stops()
    pose = stops[seed % len(stops)] + rng.uniform([-3.0, -3.0, -0.5], [3.0, 3.0, 0.5])
    bearing = rng.uniform(-np.pi, np.pi)
    off = [distance * np.cos(bearing), distance * np.sin(bearing), rng.choice([-angle, angle])]
    deviations = np.array([distance / 1.5, distance / 1.5, angle / 1.5, _FIXED, _FIXED, _FIXED / 10.0, _FIXED, _FIXED])
    correction = composed(pose + np.array(off), inverse(pose))
    prior = Prior(correction, np.zeros(3), np.zeros(2), np.diag(deviations**2))
    return _Start(maker.scan(still(pose), still(pose), seed=1000 + seed), prior, pose)


def _measured(register: Register, starts: List[_Start]) -> tuple:
    """Return CPU seconds and errors of the position [m], both (n,); the first start is done twice, to load things."""
    register(starts[0].scan, starts[0].prior)
    seconds, errors = [], []
    for start in starts:
        begin = time.process_time()
        correction = register(start.scan, start.prior)
        seconds.append(time.process_time() - begin)
        found = composed(correction, start.pose)
        is_turned = abs(float(wrapped(found[2] - start.pose[2]))) > MOST_TURNED
        errors.append(np.inf if is_turned else float(np.hypot(*(found - start.pose)[:2])))
    return np.array(seconds), np.array(errors)


def _told(errors: np.ndarray) -> str:
    found = int(np.count_nonzero(errors < NEAR))
    return f"{np.median(errors):.2f} m off, {found} of {len(errors)} within {NEAR:g} m"


def _best_of_each(errors: Dict[str, np.ndarray]) -> List[str]:
    """Return of each registration the name with the reach that errs least."""
    kinds: Dict[str, List[str]] = {}
    for name in errors:
        if name != OURS:
            kinds.setdefault(name.partition(",")[0], []).append(name)
    return [min(names, key=lambda name: float(np.median(errors[name]))) for names in kinds.values()]


def _absent() -> List[str]:
    return [name for name, module in (("Open3D", "open3d"), ("small_gicp", "small_gicp")) if find_spec(module) is None]


def _registrations(target: Blocks) -> Dict[str, Register]:
    matcher = DistributionMatcher(DistributionMatcherParameters())
    ways: Dict[str, Register] = {
        OURS: lambda scan, prior: matcher.match(scan, target, prior).correction(scan),
    }
    blocks = target.mean[:, :2]
    for reach in REACHES:
        if find_spec("open3d") is not None:
            ways.update({f"{name}, reach {reach:g} m": way for name, way in _open3d(blocks, reach).items()})
        if find_spec("small_gicp") is not None:
            ways[f"small_gicp, reach {reach:g} m"] = _small_gicp(blocks, reach)
    return ways


def _upright(places: np.ndarray) -> np.ndarray:
    """Return places (n, 2) at several levels, (m, 3)."""
    return np.vstack([np.column_stack([places, np.full(len(places), level)]) for level in _LEVELS])


def _planar(matrix: np.ndarray) -> np.ndarray:
    return np.array([matrix[0, 3], matrix[1, 3], np.arctan2(matrix[1, 0], matrix[0, 0])])


def _open3d(blocks: np.ndarray, reach: float) -> Dict[str, Register]:
    open3d = import_module("open3d")
    registration = open3d.pipelines.registration
    limit = registration.ICPConvergenceCriteria(max_iteration=MOST_ITERATIONS)

    def cloud(points: np.ndarray) -> object:
        made = open3d.geometry.PointCloud(open3d.utility.Vector3dVector(points))
        made.estimate_normals(open3d.geometry.KDTreeSearchParamKNN(NEIGHBORS))
        return made

    target = cloud(_upright(blocks))

    def way(register: Callable, estimation: object) -> Register:
        def run(scan: Scan, prior: Prior) -> np.ndarray:
            source = cloud(_upright(scan.points[:, :2]))
            found = register(source, target, reach, matrices(prior.correction), estimation, limit)
            return _planar(found.transformation)

        return run

    return {
        "Open3D ICP": way(registration.registration_icp, registration.TransformationEstimationPointToPoint()),
        "Open3D point to plane": way(
            registration.registration_icp, registration.TransformationEstimationPointToPlane()
        ),
        "Open3D GICP": way(
            registration.registration_generalized_icp, registration.TransformationEstimationForGeneralizedICP()
        ),
    }


def _small_gicp(blocks: np.ndarray, reach: float) -> Register:
    small_gicp = import_module("small_gicp")
    target, tree = small_gicp.preprocess_points(_upright(blocks), downsampling_resolution=0.1, num_neighbors=NEIGHBORS)

    def run(scan: Scan, prior: Prior) -> np.ndarray:
        source, _ = small_gicp.preprocess_points(
            _upright(scan.points[:, :2]), downsampling_resolution=0.1, num_neighbors=NEIGHBORS
        )
        found = small_gicp.align(
            target, source, tree, matrices(prior.correction), max_correspondence_distance=reach,
            max_iterations=MOST_ITERATIONS,
        )  # fmt: skip
        return _planar(found.T_target_source)

    return run
