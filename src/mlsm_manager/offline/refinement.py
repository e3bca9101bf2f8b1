"""Smooths a whole run after it is over: all scans and the calibration at once, and the map drawn anew."""

from dataclasses import dataclass
from typing import Sequence

import numpy as np

from mlsm_manager.matching.problem.scan import Scan, Track
from mlsm_manager.multi_view.batch_solver import BatchResult, solved
from mlsm_manager.multi_view.drawing import drawn
from mlsm_manager.multi_view.live_solver import LiveSolver
from mlsm_manager.multi_view.path import solved_path
from mlsm_manager.surface_map.blocks import Blocks
from mlsm_manager.surface_map.mlsm import MultiLevelSurfaceMap


@dataclass(frozen=True)
class Refined:
    """poses: (m, 3) T_map_base at the recording's odometry times. blocks: of the map drawn anew. batch: the fit."""

    poses: np.ndarray
    blocks: Blocks
    batch: BatchResult


def refine(track: Track, scans: Sequence[Scan], solver: LiveSolver, resolution: float) -> Refined:
    """Return the run of all `scans` that `solver` has taken, fitted at once; the live run is where the fit begins.

    resolution: side of a cell of the map, m.
    """
    batch = solved(solver)
    surfaces = MultiLevelSurfaceMap(resolution)
    for scan in scans:
        surfaces.insert(drawn(solver.log, solver.odometry, batch.state, scan.points, scan.times))
    poses = solved_path(track, solver.odometry, batch.node_times, batch.state.nodes, track.times)
    return Refined(poses, surfaces.blocks, batch)
