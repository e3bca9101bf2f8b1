"""Smooths a whole run after it is over: all scans and the calibration at once, and the map drawn anew."""

from dataclasses import dataclass
from typing import Mapping, Sequence

import numpy as np

from mlsm_manager.joint_solver.placing.path import solved_path
from mlsm_manager.joint_solver.solve.batch_solver import BatchResult, Closed, closed
from mlsm_manager.joint_solver.solve.live_solver import LiveSolver
from mlsm_manager.localisation.clouds import Cloud
from mlsm_manager.localisation.estimator import MapSettings
from mlsm_manager.localisation.keyframe_map import KeyframeMap
from mlsm_manager.localisation.odometry_profiles import fitted
from mlsm_manager.localisation.placement import SolvedPlacement
from mlsm_manager.scan_matching.scan import Scan, Track
from mlsm_manager.surface_map.blocks import Blocks
from mlsm_manager.surface_map.map_file import Layer


@dataclass(frozen=True)
class Refined:
    """poses: (m, 3) T_map_base at the recording's odometry times. layers: of the map drawn anew.

    closing: the fit, and the places visited again that it goes back to.
    """

    poses: np.ndarray
    layers: Mapping[Layer, Blocks]
    closing: Closed

    @property
    def batch(self) -> BatchResult:
        """The fit."""
        return self.closing.batch


def refine(track: Track, scans: Sequence[Scan], solver: LiveSolver, settings: MapSettings) -> Refined:
    """Return the run of all `scans` that `solver` has taken, fitted at once; the live run is where the fit begins."""
    closing = closed(solver, fitted(solver))
    surfaces = KeyframeMap(settings.resolution, settings.limit, carver=settings.carver)
    for scan in scans:
        surfaces.add(Cloud.of_scan(scan))
    surfaces.settle(SolvedPlacement(solver.log, solver.odometry, closing.batch.state))
    poses = solved_path(track, solver.odometry, closing.batch.node_times, closing.batch.state.nodes, track.times)
    return Refined(poses, {Layer.SHOWN: surfaces.map.blocks, Layer.FREE: surfaces.free.blocks}, closing)
