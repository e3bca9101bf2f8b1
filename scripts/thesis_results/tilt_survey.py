"""7.3: the harbour surveyed by stepping the tilt servo, as blocks."""

import math
from typing import Dict, List

import numpy as np
from benchmarks.recorded import ROOT
from benchmarks.survey_figures import FAN_BEAM, NO_CHANGES, RESOLUTION, Survey, block_errors

from mlsm_manager.surface_map.blocks import Blocks, BlockType
from node_support.geometry import pose_matrix
from sonar_simulator.world.world import World
from sonar_simulator.world.world_file import load_world
from thesis_results.block_views import draw_in_space
from thesis_results.markdown import joined, prose, table
from thesis_results.pictures import Pictures, new_figure

PLACE = (-20.0, 10.0, -2.5)
"""Of the sonar, m: in the corner of the quays."""
SURVEYS = {
    "short range, 12 m": (NO_CHANGES, {"max_range": 12.0}),
    "long range, 50 m": (NO_CHANGES, {"max_range": 50.0}),
    "long range, fan beam of 22 deg": (FAN_BEAM, {"max_range": 50.0}),
}
_SEEN_FROM = math.radians(-50.0), math.radians(38.0)  # direction and elevation: over the open side of the harbour


def make(pictures: Pictures) -> str:
    """Return the section."""
    world = load_world(ROOT / "worlds/harbour.sdf").world
    found = {name: Survey(head, world, pose_matrix(PLACE), echoes).run() for name, (head, echoes) in SURVEYS.items()}
    shown = [_shown(pictures, f"survey_{number}", name, found[name]) for number, name in enumerate(found, start=1)]
    return joined(
        prose(f"""`sonar_control` steps the tilt servo from -60 to 60 degrees and takes a full scan at each step;
        the default chain (Otsu, statistical removal) and a map of {RESOLUTION:g} m cells do the rest. The sonar is
        at ({PLACE[0]:g}, {PLACE[1]:g}, {PLACE[2]:g}) m, in the corner of the quays of `worlds/harbour.sdf`. Compare
        with figures 7.5 and 7.6 of the thesis: near walls fuse into blocks of their whole height, and far ones are
        seen as stripes, one for each step of the servo."""),
        *shown,
        table(["", *found], _rows(list(found.values()), world)),
        prose("""Distances are those of the worst of each block's mean, top and bottom from the nearest surface of
        the world. A fan beam tells nothing about the height of its echoes: see [which head for
        heights](sonar_control.md#which-head-for-heights)."""),
    )


def _shown(pictures: Pictures, file: str, name: str, blocks: Blocks) -> str:
    figure, ((axes,),) = new_figure(10.0, 6.0)
    draw_in_space(axes, blocks, *_SEEN_FROM)
    return pictures.save(
        file, figure, f"{name.capitalize()}: {len(blocks)} blocks. Light yellow: vertical, red: horizontal."
    )


def _rows(found: List[Blocks], world: World) -> List[List[str]]:
    errors = [block_errors(blocks, world) for blocks in found]
    kinds: Dict[str, BlockType] = {"horizontal": BlockType.HORIZONTAL, "vertical": BlockType.VERTICAL}
    rows = [
        [f"{name} blocks", *(str(np.count_nonzero(blocks.type == kind)) for blocks in found)]
        for name, kind in kinds.items()
    ]
    rows.append(["highest block", *(f"{blocks.depth.max():.1f} m" for blocks in found)])
    for name, quantile in (("median", 0.5), ("95 % are below", 0.95)):
        rows.append([f"distance from the surfaces, {name}", *(f"{np.quantile(one, quantile):.2f} m" for one in errors)])
    rows.append(["blocks within one cell", *(f"{100.0 * np.mean(one <= RESOLUTION):.1f} %" for one in errors)])
    return rows
