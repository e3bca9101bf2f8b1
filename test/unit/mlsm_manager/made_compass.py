"""Scans of a vehicle that has a compass and nothing else, and a solver for them that is quick."""

from made_models import HEADING, solver_parameters

from mlsm_manager.scan_matching.scan import Scan, Track

PARAMETERS = solver_parameters(
    odometry=HEADING,
    sonar_delay_deviation=1.0,
    scans_per_group=1,
    normal_deviation=0.2,
    free_scans=12,
)


def with_heading_only(scan):
    """Return a scan of an odometry whose position stays at 0."""
    poses = scan.track.poses * [0.0, 0.0, 1.0]
    points = scan.points.copy()
    points[:, :2] -= scan.track.at(scan.times)[:, :2]
    return Scan(points, scan.times, scan.moving, Track(scan.track.times, poses), scan.reference_time)
