"""A joint run as arrays, so that a node that is started again goes on with it.

Points are kept as they were heard, not where they were drawn, so that they may move as if the node had never been away.
What the maps hold without those that may still move is kept for the cells that these lie in.
"""

from dataclasses import dataclass
from typing import Callable, Dict, List, Mapping, Optional, Sequence

import numpy as np

from mlsm_manager.localisation.timed_points import TimedPoints
from mlsm_manager.scan_matching.scan import Scan, Track
from mlsm_manager.surface_map.blocks import ROW_WIDTH
from mlsm_manager.surface_map.overlay import Covered
from node_support.errors import RefusedInput

_PREFIX, _SOLVER = "run.", "solver."


@dataclass(frozen=True)
class StoredRun:
    """T_map_odom: (3,) that moves the scans before they are solved. sonar_in_base: (2,) m. scans: all, oldest first.

    solver: see LiveSolver.
    clouds: of the map that is shown, whose places may still change. shown, matched: what both maps hold without such
    keyframes, where these lie.
    """

    T_map_odom: np.ndarray
    sonar_in_base: np.ndarray
    scans: Sequence[Scan]
    solver: Mapping[str, np.ndarray]
    clouds: Sequence[TimedPoints]
    shown: Covered
    matched: Covered

    def arrays(self) -> Dict[str, np.ndarray]:
        """Return it as arrays that a map's file keeps."""
        scans, tracks = self.scans, [scan.track for scan in self.scans]
        parts = {
            "T_map_odom": self.T_map_odom,
            "sonar_in_base": np.asarray(self.sonar_in_base),
            **{_SOLVER + name: array for name, array in self.solver.items()},
            **_joined("scan", [TimedPoints.of_scan(scan) for scan in scans]),
            "scan_moving": np.concatenate([np.empty(0), *(scan.moving for scan in scans)]).astype(np.uint8),
            "track_times": np.concatenate([np.empty(0), *(track.times for track in tracks)]),
            "track_poses": np.concatenate([np.empty((0, 3)), *(track.poses for track in tracks)]),
            "track_lengths": np.array([len(track.times) for track in tracks], dtype=np.int64),
            **_joined("cloud", self.clouds),
            **_covered_arrays("shown", self.shown),
            **_covered_arrays("matched", self.matched),
        }
        return {_PREFIX + name: array for name, array in parts.items()}

    @staticmethod
    def of_arrays(arrays: Mapping[str, np.ndarray]) -> "Optional[StoredRun]":
        """Return what `arrays` gave; None where they hold no run. Whether `solver` is whole shows when it is used."""
        solver = {name[len(_PREFIX + _SOLVER) :]: arrays[name] for name in arrays if name.startswith(_PREFIX + _SOLVER)}
        try:
            return _run_of(lambda name: arrays[_PREFIX + name], solver)
        except (KeyError, ValueError, IndexError, RefusedInput):
            return None


def _run_of(part: Callable[[str], np.ndarray], solver: Mapping[str, np.ndarray]) -> StoredRun:
    heard, moving = _split("scan", part), _parts(part("scan_moving"), part("scan_lengths"))
    times, poses = (_parts(part(f"track_{name}"), part("track_lengths")) for name in ("times", "poses"))
    if not 0 < len(heard) == len(moving) == len(times):
        raise ValueError(f"{len(heard)} scans, {len(times)} tracks")
    scans = [
        Scan(cloud.points, cloud.times, flags.astype(bool), Track(*track), cloud.end)
        for cloud, flags, *track in zip(heard, moving, times, poses)
    ]
    for name, size in (("T_map_odom", 3), ("sonar_in_base", 2)):
        if part(name).shape != (size,) or not np.isfinite(part(name)).all():
            raise ValueError(f"{name} {part(name)}")
    shown, matched = (_covered_of(name, part) for name in ("shown", "matched"))
    return StoredRun(part("T_map_odom"), part("sonar_in_base"), scans, solver, _split("cloud", part), shown, matched)


def _joined(name: str, clouds: Sequence[TimedPoints]) -> Dict[str, np.ndarray]:
    return {
        f"{name}_points": np.concatenate([np.empty((0, 4)), *(cloud.points for cloud in clouds)]),
        f"{name}_times": np.concatenate([np.empty(0), *(cloud.times for cloud in clouds)]),
        f"{name}_ends": np.array([cloud.end for cloud in clouds], dtype=np.float64),
        f"{name}_lengths": np.array([len(cloud) for cloud in clouds], dtype=np.int64),
    }


def _split(name: str, part: Callable[[str], np.ndarray]) -> List[TimedPoints]:
    points, times = (_parts(part(f"{name}_{kind}"), part(f"{name}_lengths")) for kind in ("points", "times"))
    ends = part(f"{name}_ends")
    if len(ends) != len(points) or any(there.shape != (len(then), 4) for there, then in zip(points, times)):
        raise ValueError(f"{name}s whose arrays do not belong together")
    return [TimedPoints(there, then, float(end)) for there, then, end in zip(points, times, ends)]


def _parts(array: np.ndarray, lengths: np.ndarray) -> List[np.ndarray]:
    if lengths.sum() != len(array):
        raise ValueError(f"{len(array)} elements, must be {lengths.sum()}")
    return np.split(array, np.cumsum(lengths)[:-1]) if len(lengths) else []


def _covered_arrays(name: str, covered: Covered) -> Dict[str, np.ndarray]:
    return {f"{name}_cells": covered.cells, f"{name}_rows": covered.rows, f"{name}_crossed": covered.crossed}


def _covered_of(name: str, part: Callable[[str], np.ndarray]) -> Covered:
    cells, rows, crossed = (part(f"{name}_{kind}") for kind in ("cells", "rows", "crossed"))
    if cells.shape != (len(cells), 2) or rows.shape != (len(crossed), ROW_WIDTH) or not np.isfinite(rows).all():
        raise ValueError(f"{name}: cells {cells.shape}, blocks {rows.shape}")
    return Covered(cells, rows, crossed)
