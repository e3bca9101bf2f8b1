"""Scans and clouds moved from an odometry that may jump to one that goes on; see ContinuousOdometry."""

from dataclasses import replace

import numpy as np

from mlsm_manager.localisation.clouds import MapCloud
from mlsm_manager.odometry.steps import ContinuousOdometry
from mlsm_manager.odometry.trembling import with_headings_smoothed
from mlsm_manager.scan_matching.scan import Scan
from node_support.geometry import composed, inverse, transformed


def continuous_scan(odometry: ContinuousOdometry, scan: Scan) -> Scan:
    """Learn a scan's odometry, and return the scan with one that goes on, and whose headings do not tremble."""
    smooth, trembling = with_headings_smoothed(scan.track)
    if trembling:
        odometry.trembling = odometry.trembling or trembling
        moves = composed(smooth.at(scan.times), inverse(scan.track.at(scan.times)))
        scan = replace(scan, points=transformed(moves, scan.points), track=smooth)
    odometry.take(scan.track)
    if not odometry.steps:
        return scan
    points = _moved(odometry, scan.points, scan.times)
    return replace(scan, points=points, track=odometry.followed(scan.track))


def continuous_cloud(odometry: ContinuousOdometry, cloud: MapCloud) -> MapCloud:
    """Return a cloud of which the odometry is known where an odometry that goes on puts it."""
    if not odometry.steps:
        return cloud
    return replace(cloud, points=_moved(odometry, cloud.points, cloud.times))


def _moved(odometry: ContinuousOdometry, points: np.ndarray, times: np.ndarray) -> np.ndarray:
    """Return points (n, 4) [m] in odom, of `times` (n,) s, in the odometry that goes on."""
    return transformed(odometry.fixes(times), points) if len(points) else points
