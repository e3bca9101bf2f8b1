"""7.2: a simulated scan of 50 m through the processing chain."""

import math
from typing import List

import numpy as np
from benchmarks.basin_scans import BasinScans
from benchmarks.recorded import ROOT
from benchmarks.shape_figures import WallErrors, wall_errors
from benchmarks.world_distance import distances

from node_support.geometry import pose_matrix
from sonar_processing.cloud import IntensityCloud
from sonar_processing.shapes.lines import LineDetectorParameters
from sonar_simulator.world.world import World
from sonar_simulator.world.world_file import load_world
from thesis_results.markdown import joined, prose, table
from thesis_results.pictures import Pictures
from thesis_results.processing_chain import Processed, draw_stages, processed

REACH = 50.0
PLACE = pose_matrix((-20.0, -3.0, -1.8))
THESIS_OTSU = 66
"""What the thesis reports for its simulated scan of 50 m (7.2)."""
_ON = 1.0  # m: the standard deviation of an echo in the thesis's model
_SPREADS = {"pulse of the thesis's model, 1 m": 1.0, "pulse of a real head, 0.15 m": 0.15}


def make(pictures: Pictures) -> str:
    """Return the section."""
    world = load_world(ROOT / "worlds/basin.sdf").world
    found = {name: _scan(spread) for name, spread in _SPREADS.items()}
    shown = [
        draw_stages(
            pictures, f"processed_{number}", scan, REACH,
            f"""One turn of 120 beams in the basin, {name}: all bins, after the threshold, after the removal of
            outliers, and the walls that `line_detector` finds. Compare with figures 7.2 and 7.4 of the thesis.""",
        )
        for number, (name, scan) in enumerate(found.items(), start=1)
    ]  # fmt: skip
    return joined(
        prose(f"""The thesis reports Otsu's threshold for such a scan as about {THESIS_OTSU} and advises to raise it
        a bit; the default mode multiplies it by `otsu_multiplier`. All parameters are the defaults."""),
        *shown,
        table(["", *found], _rows(list(found.values()), world)),
    )


def _scan(spread: float) -> Processed:
    return processed(BasinScans(spread).scan(PLACE, seed=1), PLACE[:2, 3], LineDetectorParameters())


def _rows(found: List[Processed], world: World) -> List[List[str]]:
    rows = [
        ["Otsu's threshold", *(f"{scan.otsu:.0f}" for scan in found)],
        ["threshold that was used", *(f"{scan.threshold:.0f}" for scan in found)],
    ]
    for stage in found[0].stages:
        shares = [_share_on_surfaces(scan.stages[stage], world) for scan in found]
        rows.append([f"echoes within {_ON:g} m of a surface, {stage}", *(f"{100.0 * share:.0f} %" for share in shares)])
    errors = [wall_errors(scan.lines, PLACE, REACH) for scan in found]
    return [
        *rows,
        ["walls found, of those within reach", *(f"{len(_found(walls))} of {len(walls)}" for walls in errors)],
        ["largest errors of these", *(_largest(_found(walls)) for walls in errors)],
    ]


def _share_on_surfaces(cloud: IntensityCloud, world: World) -> float:
    """Return the share of points with any strength that lie on a surface; they are drawn at the depth of the sonar."""
    points = cloud.points[cloud.valid]
    return float(np.mean(distances(world, points[points[:, 3] > 0, :3]) <= _ON))


def _found(walls: List[WallErrors]) -> List[WallErrors]:
    return [wall for wall in walls if wall.distance is not None]


def _largest(walls: List[WallErrors]) -> str:
    distance, angle = max(wall.distance for wall in walls), max(wall.angle for wall in walls)
    return f"{distance:.2f} m, {math.degrees(angle):.2f} deg"
