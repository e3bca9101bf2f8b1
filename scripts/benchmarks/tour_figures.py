"""Circles found on straight and turning tours of three worlds: on buoys, pipes and piles, or on walls."""

import time
from collections import Counter
from typing import List, Set, Tuple

import numpy as np

from benchmarks.table import Row
from benchmarks.tour_scans import TourScan, tour_scans, tour_setup
from sonar_processing.filters.threshold import Thresholder, ThresholderParameters
from sonar_processing.shapes.circles import CircleDetector, CircleDetectorParameters
from sonar_simulator.world.world import Shape, World

SEEDS = 10
WORLDS = ("basin", "tank", "harbour")
TOURS = {"straight": "tour", "turning": "turning_tour"}
NEAR = 15.0
_SAME_THING = 1.0
_ON_A_WALL = 1.5
_FLOOR_RATIO = 10.0


class Truth:
    """What a circle in a world may stand on."""

    def __init__(self, world: World, parameters: CircleDetectorParameters) -> None:
        upright = [shape for shape in world.shapes if shape.mesh is None and abs(shape.pose[2, 2]) > 0.9]
        self._widest = 2.0 * parameters.max_radius
        rounds = [shape for shape in upright if shape.kind in ("cylinder", "sphere")]
        self._round = [shape for shape in rounds if shape.size[0] <= parameters.max_radius]
        self._too_large = [shape for shape in rounds if shape.size[0] > parameters.max_radius]
        self._flat = [shape for shape in upright if shape.kind == "box" and not _is_floor(shape)]

    def thing(self, center: np.ndarray) -> int:
        """Return the number of the thing of a circle's size at a place (2,) x y [m], -1 where none is."""
        off = [_plan_distance(shape, center) for shape in self._round]
        return int(np.argmin(off)) if off and min(off) <= _SAME_THING else -1

    def place(self, thing: int) -> np.ndarray:
        """Return (2,) x y [m] of a round thing."""
        return self._round[thing].pose[:2, 3]

    def flat(self, center: np.ndarray) -> str:
        """Return what stands at a place that is at no thing as small as circles."""
        if any(_plan_distance(shape, center) <= _SAME_THING for shape in self._too_large):
            return "larger round things"
        off, shape = min(((_plan_distance(shape, center), shape) for shape in self._flat), key=lambda found: found[0])
        if off > _ON_A_WALL:
            return "open water"
        return "ends of finger pontoons" if min(shape.size[:2]) <= self._widest else "walls"


def _is_floor(shape: Shape) -> bool:
    return min(shape.size[:2]) > _FLOOR_RATIO * shape.size[2]


def _plan_distance(shape: Shape, center: np.ndarray) -> float:
    """Return the distance [m] of a place from a shape's outline as seen from above."""
    local = shape.pose[:2, :2].T @ (center - shape.pose[:2, 3])
    if shape.kind != "box":
        return abs(float(np.hypot(*local)) - shape.size[0])
    beyond = np.abs(local) - np.array(shape.size[:2]) / 2.0
    return float(np.hypot(*np.maximum(beyond, 0.0))) if beyond.max() > 0.0 else float(-beyond.max())


def tour_rows(world: str, tour: str) -> List[Row]:
    """Return where the circles of a tour stand, how many buoys were found from near, and the time of a scan."""
    detector, where = CircleDetector(CircleDetectorParameters()), Counter()
    seconds: List[float] = []
    found: Set[Tuple[int, int, int]] = set()
    for seed in range(SEEDS):
        settings, setup = tour_setup(world, TOURS[tour], seed)
        truth = Truth(setup.world, detector.parameters)
        for number, scan in enumerate(tour_scans(settings, setup)):
            cloud = Thresholder(ThresholderParameters())(scan.cloud)
            start = time.process_time()
            circles = detector(cloud, scan.sonar_positions)
            seconds.append(time.process_time() - start)
            for circle in circles:
                thing = truth.thing(circle.center)
                where["buoys, pipes and piles" if thing >= 0 else truth.flat(circle.center)] += 1
                if thing >= 0 and _is_near(scan, truth.place(thing)):
                    found.add((seed, number, thing))
    listed = ", ".join(f"{count} on {name}" for name, count in sorted(where.items())) or "none"
    name = f"{world}, {tour} tour, {len(seconds)} scans"
    return [
        (f"{name}: circles", listed, "0 on walls"),
        (f"{name}: buoys, pipes and piles within {NEAR:.0f} m found", str(len(found)), ""),
        (f"{name}: time of a scan", f"{1e3 * np.mean(seconds):.0f} ms, at most {1e3 * max(seconds):.0f}", "<= 30 ms"),
    ]


def _is_near(scan: TourScan, place: np.ndarray) -> bool:
    stamp = np.abs(scan.cloud.time_stamps).mean(keepdims=True)
    return bool(np.linalg.norm(scan.sonar_positions(stamp)[0] - place) <= NEAR)


def rows() -> List[Row]:
    """Return the figures of all tours."""
    return [row for world in WORLDS for tour in TOURS for row in tour_rows(world, tour)]
