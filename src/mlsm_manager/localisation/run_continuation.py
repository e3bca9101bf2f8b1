"""Whether an interrupted run goes on with a scan: the joint solver puts it somewhere, and the map must agree."""

from typing import Optional

import numpy as np

from mlsm_manager.localisation.clouds import Cloud
from mlsm_manager.localisation.joint_session import JointSession
from mlsm_manager.scan_matching.scan import Scan
from mlsm_manager.surface_map.mlsm import MultiLevelSurfaceMap
from node_support.errors import RefusedInput

_LEAST_SHARE = 0.75
"""Share of a scan's points that must lie on surfaces of the map. In a marina 0.78 to 1 do where the vehicle is, and
0.71 at most where it was put 10 m or more aside."""
_MOST_BY_CHANCE = 0.75
"""Share of those near the map that may be near it beside their place too: else there are blocks everywhere."""
_ASIDE = 0.3
"""Share of the points' median distance by which they are shifted to see that."""
_DIRECTIONS = np.linspace(0.0, 2.0 * np.pi, 8, endpoint=False)


def continued(session: JointSession, scan: Scan, surface_map: MultiLevelSurfaceMap) -> Optional[JointSession]:
    """Return the run with one more scan where the scan lies on the map; None where it does not.

    surface_map: of the matched echoes, without this scan. `session` itself stays as it is.
    """
    longer = session.copied()
    try:
        agreement = longer.add(scan).agreement
    except RefusedInput:
        return None
    points = longer.points(Cloud.of_scan(scan))[:, :2]
    near = _share_near_blocks(points, surface_map)
    if near * agreement < _LEAST_SHARE:
        return None
    return longer if _share_by_chance(points, longer, surface_map) <= _MOST_BY_CHANCE * near else None


def _share_by_chance(points: np.ndarray, session: JointSession, surface_map: MultiLevelSurfaceMap) -> float:
    """Return the share of points (n, 2) near blocks of the map if the scan were some metres beside its place."""
    place = session.solver.estimates[-1].T_map_base[:2]
    aside = _ASIDE * float(np.median(np.hypot(*(points - place).T)))
    shifts = aside * np.column_stack([np.cos(_DIRECTIONS), np.sin(_DIRECTIONS)])
    return float(np.mean([_share_near_blocks(points + shift, surface_map) for shift in shifts]))


def _share_near_blocks(points: np.ndarray, surface_map: MultiLevelSurfaceMap) -> float:
    """Return the share of points (n, 2) in cells that hold a block or adjoin one that does; 0 without points."""
    if not len(points):
        return 0.0
    return float(surface_map.is_near(points).mean())
