"""What is heard in a sector of the vehicle's own hull goes, wherever the vehicle is and turns to."""

import numpy as np
import pytest
from clouds import SECOND

from node_support.errors import RefusedInput
from node_support.geometry import pose_matrix
from sonar_processing.cloud import Cloud
from sonar_processing.filters.sector_mask import SectorMask, SectorMaskParameters

BEARINGS = np.radians(np.arange(-175.0, 180.0, 10.0))
RANGES = np.array([1.0, 3.0])
ASTERN = SectorMaskParameters(start_angle=np.radians(150.0), width=np.radians(60.0), reach=2.0)
"""Thirty degrees to both sides of the sonar's -x axis: across the angle at which headings begin again."""


def sonar_poses(frame_id, times):
    """Return where a sonar is that goes along, turns about its axis, and is tilted: T_odom_sonar (m, 4, 4)."""
    assert frame_id == "odom"
    return np.array([pose_matrix((40.0 + time, -7.0, -2.0), (0.0, 0.2, 0.3 * time)) for time in times])


def turn_of(organized):
    """Return a turn of the head as it comes in odom: a beam a second, each with two bins."""
    times = np.arange(1.0, len(BEARINGS) + 1)
    ahead = np.column_stack([np.cos(BEARINGS), np.sin(BEARINGS), np.zeros(len(BEARINGS))])
    rows = np.ones((len(BEARINGS), len(RANGES), 4))
    for row, pose, direction in zip(rows, sonar_poses("odom", times), ahead):
        row[:, :3] = pose[:3, 3] + RANGES[:, np.newaxis] * (pose[:3, :3] @ direction)
    signs = np.where(np.arange(len(times)) % 2, 1.0, -1.0)
    stamps = np.repeat(signs * times, len(RANGES))
    height = len(BEARINGS) if organized else 1
    return Cloud(rows.reshape(-1, 4).astype(np.float32), stamps, len(times) * SECOND, "odom", height, organized)


def wanted():
    """Return which points stay: all but the near ones astern."""
    astern = np.abs(BEARINGS) > np.radians(150.0)
    return ~(astern[:, np.newaxis] & (RANGES < 2.0)).ravel()


def test_the_near_points_of_the_sector_go_with_their_stamps_in_whichever_pose_the_sonar_was():
    cloud = turn_of(organized=False)
    masked = SectorMask(ASTERN, sonar_poses)(cloud)
    np.testing.assert_array_equal(masked.points, cloud.points[wanted()])
    np.testing.assert_array_equal(masked.time_stamps, cloud.time_stamps[wanted()])


def test_a_polar_scan_keeps_its_rows_and_its_removed_bins():
    cloud = turn_of(organized=True)
    cloud.points[5] = np.nan
    masked = SectorMask(ASTERN, sonar_poses)(cloud)
    assert (masked.height, masked.organized) == (cloud.height, True)
    np.testing.assert_array_equal(masked.valid, wanted() & cloud.valid)


def test_without_a_width_nobody_is_asked_where_the_sonar_was():
    cloud = turn_of(organized=False)
    assert SectorMask(SectorMaskParameters(), lambda *_: pytest.fail("was asked"))(cloud) is cloud


def test_beams_of_unknown_places_stay_and_a_scan_of_none_is_refused():
    def mostly_known(frame_id, times):
        poses = sonar_poses(frame_id, times)
        poses[:2] = np.nan
        return poses

    def unknown(*_):
        raise RefusedInput("scans without sonar position", "sonar in odom: unknown to tf")

    stays = wanted()
    stays[: 2 * len(RANGES)] = True
    cloud = turn_of(organized=False)
    np.testing.assert_array_equal(SectorMask(ASTERN, mostly_known)(cloud).points, cloud.points[stays])
    with pytest.raises(RefusedInput, match="unknown to tf"):
        SectorMask(ASTERN, unknown)(cloud)
