"""How much of each scan lies on what was heard just before it."""

import numpy as np

from mlsm_manager.multi_view.motion_search import COMPARED_SCANS, fits
from mlsm_manager.multi_view.odometry_model import OdometryModel
from mlsm_manager.multi_view.parameters import SurfaceMatching
from mlsm_manager.multi_view.placement import place
from mlsm_manager.multi_view.run_log import RunLog
from mlsm_manager.multi_view.state import State


def shares_heard_before(
    log: RunLog, odometry: OdometryModel, state: State, matching: SurfaceMatching, first: int
) -> np.ndarray:
    """Return which share (n,) of the points of scans `first` and newer lies on surfaces that the scans before heard.

    NaN for scans without points on surfaces, and for the first of the run. A scan that lies where it was heard has most
    of its points there, since a small vehicle goes less far in a turn of the head than the sonar reaches.
    """
    return np.array([_share(log, odometry, state, matching, scan) for scan in range(first, log.scan_count)])


def _share(log: RunLog, odometry: OdometryModel, state: State, matching: SurfaceMatching, scan: int) -> float:
    before, own = log.rows(max(0, scan - COMPARED_SCANS), scan), log.rows(scan, scan + 1)
    if not len(before) or not len(own):
        return np.nan
    sources, targets = (place(log, odometry, state, rows) for rows in (own, before))
    return float(fits(sources, targets, sources.places[np.newaxis], matching)[0] / sources.qualities.sum())
