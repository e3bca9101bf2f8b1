"""What is stored to go on after a restart, the vehicle's place and its joint run, and whether that still holds.

Points of a run are kept as they were heard, not where they were drawn, so that they may move as if the node had never
been away. What the maps hold without those that may still move is kept for the cells that these lie in.
"""

from dataclasses import dataclass, replace
from typing import Dict, Mapping, Optional, Sequence

import numpy as np

from mlsm_manager.joint_solver.run_log import stacked, unstacked
from mlsm_manager.localisation.joint_session import JointSession
from mlsm_manager.scan_matching.judgement import agreement
from mlsm_manager.scan_matching.scan import Belief, MapCloud, Scan, Track
from mlsm_manager.scan_matching.scan_path import POSE, STATES
from mlsm_manager.surface_map.blocks import ROW_WIDTH
from mlsm_manager.surface_map.mlsm import Covered, MultiLevelSurfaceMap
from node_support.errors import RefusedInput
from node_support.geometry import seen_from

# m and rad that a vehicle may have strayed from the stored correction while nobody watched: some seconds of a restart.
_STRAYED = np.array([1.0, 1.0, 0.1])
_LONGEST_BRIDGE = 30.0  # s: in one or two turns of a head a vehicle hardly leaves a straight line
# In simulated tours and a marina 0.85 to 1 of a scan lie on the map where the vehicle is, and the two agree by 0.44 to
# 0.98; of scans 5 m or more aside that agree by 0.4 with the map, 0.81 at most lie on it.
_LEAST_EXPLAINED, _LEAST_AGREEMENT = 0.83, 0.4
_PREFIX, _SOLVER = "run.", "solver."


@dataclass(frozen=True)
class StoredPlace:
    """correction: (3,) T_map_odom. belief: what was known then."""

    correction: np.ndarray
    belief: Belief

    def arrays(self) -> Dict[str, np.ndarray]:
        belief = self.belief
        return {
            "T_map_odom": self.correction,
            "time": np.array([belief.time]),
            "state": belief.theta,
            "covariance": belief.covariance,
        }

    @staticmethod
    def of_arrays(arrays: Mapping[str, np.ndarray]) -> "Optional[StoredPlace]":
        """Return what `arrays` gave; None where they hold no place."""
        shapes = {"T_map_odom": (3,), "time": (1,), "state": (STATES,), "covariance": (STATES, STATES)}
        if any(name not in arrays or arrays[name].shape != shape for name, shape in shapes.items()):
            return None
        if not all(np.isfinite(arrays[name]).all() for name in shapes):
            return None
        belief = Belief(float(arrays["time"][0]), arrays["state"], arrays["covariance"])
        return StoredPlace(arrays["T_map_odom"], belief)

    def bridged(self, track: Track) -> Track:
        """Return a track that goes straight from here to its beginning, where that is some seconds later.

        A node that is started again within a scan has no odometry of the seconds before. Where it was when it was saved
        is known, and with the odometry along a straight line the echoes of those seconds lie better than without any.
        """
        if not 0.0 < track.times[0] - self.belief.time < _LONGEST_BRIDGE:
            return track
        T_odom_base = seen_from(self.correction, self.belief.theta[POSE])
        times, poses = np.append(self.belief.time, track.times), np.vstack([T_odom_base, track.poses])
        return Track(times, poses)

    @property
    def widened(self) -> Belief:
        """The belief, as unsure of the pose as a restart makes it."""
        covariance = self.belief.covariance.copy()
        covariance[POSE, POSE] += np.diag(_STRAYED**2)
        return Belief(self.belief.time, self.belief.theta, covariance)


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
    clouds: Sequence[MapCloud]
    shown: Covered
    matched: Covered

    def arrays(self) -> Dict[str, np.ndarray]:
        scans = [replace(scan, moving=scan.moving.astype(np.uint8)) for scan in self.scans]
        parts = {
            "T_map_odom": self.T_map_odom,
            "sonar_in_base": np.asarray(self.sonar_in_base),
            **{_SOLVER + name: array for name, array in self.solver.items()},
            **stacked(scans, "scan."),
            **stacked(self.clouds, "cloud."),
            **stacked([self.shown, self.matched], "covered."),
        }
        return {_PREFIX + name: array for name, array in parts.items()}

    @staticmethod
    def of_arrays(arrays: Mapping[str, np.ndarray]) -> "Optional[StoredRun]":
        """Return what `arrays` gave; None where they hold no run. Whether `solver` is whole shows when it is used."""
        arrays = _under(_PREFIX, arrays)
        try:
            scans, clouds = unstacked(Scan, arrays, "scan."), unstacked(MapCloud, arrays, "cloud.")
            shown, matched = unstacked(Covered, arrays, "covered.")
            T_map_odom, sonar_in_base = arrays["T_map_odom"], arrays["sonar_in_base"]
        except (KeyError, ValueError, IndexError, RefusedInput):
            return None
        fits = [len(scans) > 0, T_map_odom.shape == (3,), sonar_in_base.shape == (2,)]
        fits += [cloud.points.shape == (len(cloud.times), 4) for cloud in clouds]
        for covered in (shown, matched):
            fits.append(covered.cells.shape == (len(covered.cells), 2))
            fits.append(covered.rows.shape == (len(covered.crossed), ROW_WIDTH))
        fits += [np.isfinite(each).all() for each in (T_map_odom, sonar_in_base, shown.rows, matched.rows)]
        if not all(fits):
            return None
        scans = [replace(scan, moving=scan.moving.astype(bool)) for scan in scans]
        return StoredRun(T_map_odom, sonar_in_base, scans, _under(_SOLVER, arrays), clouds, shown, matched)


def resumed_if_it_fits(session: JointSession, scan: Scan, surface_map: MultiLevelSurfaceMap) -> Optional[JointSession]:
    """Return the run with one more scan where the scan lies on the map; None where it does not.

    surface_map: of the matched echoes, without this scan. `session` itself stays as it is.
    """
    longer = session.copied()
    try:
        place = longer.add(scan).T_map_base[:2]
    except RefusedInput:
        return None
    points = longer.heard(MapCloud.of_scan(scan))[0][:, :2]
    on_map = surface_map.is_near(points)
    if not on_map.any():
        return None
    explained, agreed = agreement(points, on_map, place, surface_map.blocks.mean[:, :2])
    return longer if explained >= _LEAST_EXPLAINED and agreed >= _LEAST_AGREEMENT else None


def _under(prefix: str, arrays: Mapping[str, np.ndarray]) -> Dict[str, np.ndarray]:
    return {name[len(prefix) :]: array for name, array in arrays.items() if name.startswith(prefix)}
