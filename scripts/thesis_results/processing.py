"""7.2: what the processing chain makes of a simulated and of a recorded scan, stage by stage."""

import math
from dataclasses import dataclass, replace
from typing import Dict, List

import numpy as np
from benchmarks.harness import ROOT, recorded_beams
from benchmarks.scans import basin_cloud
from matplotlib.axes import Axes

from mlsm_manager.offline.thesis_chain import ThesisChain, thesis_values
from node_support.geometry import pose_matrix
from sonar_processing.beams.beam import PlacedBeam
from sonar_processing.cloud import Cloud
from sonar_processing.filters.outliers import OutlierRemover
from sonar_processing.filters.threshold import Thresholder, ThresholdMode
from sonar_processing.scans.assembler import ScanAssembler
from sonar_processing.shapes.lines import Line, LineDetector, LineDetectorParameters
from sonar_simulator.world.world import World
from sonar_simulator.world.world_file import load_world
from thesis_results.page import joined, prose, table
from thesis_results.pictures import COLOURS, STRONGEST, Pictures, new_figure, to_scale
from thesis_results.sonar import HEAD_PLACE, TANK, TURN_BEAMS
from thesis_results.survey import distances
from thesis_results.thesis_scans import CHAIN, DEFAULTS

_REACH = 50.0
_PLACE = pose_matrix((-20.0, -3.0, -1.8))
_THESIS_OTSU = 66
"""What the thesis reports for its simulated scan of 50 m (7.2)."""
_ON = 1.0  # m: the standard deviation of an echo in the thesis's model
_SPREADS = {"pulse of the thesis's model, 1 m": 1.0, "pulse of a real head, 0.15 m": 0.15}
_THESIS_COLUMN = "`thesis:=true`, pulse of the thesis's model, 1 m"
_TANK_REACH = 10.0
# A tank is a tenth of the basin, so are its walls and what counts as near one.
_TANK_LINES = LineDetectorParameters(distance=0.1, min_length=1.5, max_gap=2.0)
_MOST_POINTS = 60_000  # of a picture: more do not show


def make_simulated(pictures: Pictures) -> str:
    """Return the section of a simulated scan of 50 m."""
    world = load_world(ROOT / "worlds/basin.sdf")
    place = _PLACE[:2, 3]
    found = {
        name: processed(basin_cloud(spread, _PLACE, 1), place, LineDetectorParameters())
        for name, spread in _SPREADS.items()
    }
    by_thesis = processed(basin_cloud(1.0, _PLACE, 1, CHAIN.clouds), place, _thesis_lines(), CHAIN)
    shown = [
        draw_stages(
            pictures, f"processed_{number}", scan, _REACH,
            f"""One turn of 120 beams in the basin, {name}: all bins, after the threshold, after the removal of
            outliers, and the walls that `line_detector` finds. Compare with figures 7.2 and 7.4 of the thesis.""",
        )
        for number, (name, scan) in enumerate(found.items(), start=1)
    ]  # fmt: skip
    return joined(
        prose(f"""The thesis reports Otsu's threshold for such a scan as about {_THESIS_OTSU} and advises to raise it
        a bit; the default mode multiplies it by `otsu_multiplier`. All parameters are the defaults, but for those of
        the last column, which are the thesis's (`yaml/thesis.yaml`)."""),
        *shown,
        table(["", *found, _THESIS_COLUMN], _rows([*found.values(), by_thesis], world)),
    )


def _thesis_lines() -> LineDetectorParameters:
    return LineDetectorParameters.from_mapping(thesis_values({})["line_detector"])


def make_recorded(pictures: Pictures) -> str:
    """Return the section of a turn of a real Micron."""
    scan = processed(_turn(DEFAULTS), HEAD_PLACE[:2, 3], _TANK_LINES)
    by_thesis = processed(_turn(CHAIN), HEAD_PLACE[:2, 3], _thesis_lines(), CHAIN)
    changed = ", ".join(f"`{name}: {getattr(_TANK_LINES, name):g}`" for name in ("distance", "min_length", "max_gap"))
    rows = [
        [
            f"{line.distance_from(HEAD_PLACE[:2, 3]):.2f} m", f"{math.degrees(line.orientation):.1f} deg",
            f"{line.length:.1f} m", str(line.echoes), f"{100.0 * line.residual:.0f} cm",
        ]
        for line in scan.lines
    ]  # fmt: skip
    both = scan, by_thesis
    counts = [
        ["threshold that was used", *(f"{one.threshold:.0f}" for one in both)],
        *(
            [f"points, {stage}", *(str(np.count_nonzero(one.stages[stage].valid)) for one in both)]
            for stage in ("thresholded", "cleaned")
        ),
        ["walls", *(str(len(one.lines)) for one in both)],
    ]
    return joined(
        draw_stages(
            pictures, "processed_recording", scan, _TANK_REACH,
            """One turn of a real Micron in a tank. The walls of the tank are about 4 m to either side, 2.1 m and 1
            m away; what is behind them are mirror echoes. Compare with figure 7.3 of the thesis.""",
        ),
        prose(f"""Otsu's threshold is {scan.otsu:.0f}; {scan.threshold:.0f} was used. `line_detector` was told the
        size of a tank: {changed}. What it found:"""),
        table(["distance from the sonar", "direction of the normal", "length", "echoes", "rms of residuals"], rows),
        prose("""Of the same turn with the thesis's settings, which are those of a basin: its lines are 1.2 m wide, and
        each bin is drawn ten times."""),
        table(["", "defaults", "`thesis:=true`"], counts),
    )  # fmt: skip


def _turn(chain: ThesisChain) -> Cloud:
    """Return the first turn as an organised cloud in the frame of the tank."""
    assembler = ScanAssembler(replace(chain.clouds, keep_organized=True, scan_size=TURN_BEAMS))
    clouds = (assembler.add(PlacedBeam(beam, HEAD_PLACE, is_moving=False)) for beam in recorded_beams(TANK))
    return next(cloud for cloud in clouds if cloud is not None and np.count_nonzero(cloud.valid))


@dataclass(frozen=True)
class Processed:
    """A scan after each stage, by its name, taken from `place` (2,) m.

    otsu, threshold: Otsu's threshold, and the one that the default mode makes of it.
    """

    place: np.ndarray
    stages: Dict[str, Cloud]
    lines: List[Line]
    otsu: float
    threshold: float


def processed(raw: Cloud, place: np.ndarray, lines: LineDetectorParameters, chain: ThesisChain = DEFAULTS) -> Processed:
    """Return what the stages of a chain, by default with their defaults, and the line detector make of a scan."""
    otsu = Thresholder(replace(chain.threshold, mode=ThresholdMode.OTSU, min_threshold=0.0))
    thresholder = Thresholder(chain.threshold)
    otsu(raw)
    thresholded = thresholder(raw)
    cleaned = OutlierRemover(chain.outliers)(thresholded)
    stages = {"raw": raw, "thresholded": thresholded, "cleaned": cleaned}
    return Processed(place, stages, LineDetector(lines)(cleaned), otsu.newest_threshold, thresholder.newest_threshold)


def draw_stages(pictures: Pictures, name: str, scan: Processed, reach: float, what: str) -> str:
    """Save the stages side by side and return their Markdown; `reach` [m] from the sonar is shown."""
    figure, (axes,) = new_figure(16.0, 4.6, 1, 4)
    for cell, (stage, cloud) in zip(axes, scan.stages.items()):
        _draw_cloud(cell, cloud)
        to_scale(cell, f"{stage}: {np.count_nonzero(cloud.valid)} points", reach, scan.place)
    cleaned = scan.stages["cleaned"]
    points = cleaned.points[cleaned.valid]
    axes[3].plot(points[:, 0], points[:, 1], ".", color="#bbbbbb", markersize=1.5)
    for line in scan.lines:
        axes[3].plot(*line.ends.T, color="#c2185b", linewidth=2.0)
    to_scale(axes[3], f"lines: {len(scan.lines)}", reach, scan.place)
    for cell in axes[1:]:
        cell.set(ylabel="")
    return pictures.save(name, figure, what)


def _draw_cloud(axes: Axes, cloud: Cloud) -> None:
    points = cloud.points[cloud.valid]
    points = points[points[:, 3] > 0]
    points = points[:: max(1, len(points) // _MOST_POINTS)]
    points = points[np.argsort(points[:, 3])]
    axes.set_facecolor("black")
    axes.scatter(points[:, 0], points[:, 1], c=points[:, 3], s=1.5, cmap=COLOURS, vmin=0, vmax=STRONGEST, linewidths=0)


def _rows(found: List[Processed], world: World) -> List[List[str]]:
    rows = [
        ["Otsu's threshold", *(f"{scan.otsu:.0f}" for scan in found)],
        ["threshold that was used", *(f"{scan.threshold:.0f}" for scan in found)],
    ]
    for stage in found[0].stages:
        shares = []
        for scan in found:
            # Points are drawn at the depth of the sonar, also those of no strength.
            points = scan.stages[stage].points[scan.stages[stage].valid]
            shares.append(np.mean(distances(world, points[points[:, 3] > 0, :3]) <= _ON))
        rows.append([f"echoes within {_ON:g} m of a surface, {stage}", *(f"{100.0 * share:.0f} %" for share in shares)])
    rows.append(["walls", *(str(len(scan.lines)) for scan in found)])
    return rows
