"""What a scan holds: its points, their stamps and its own."""

import numpy as np
import pytest
from assemblers import assembler_with, placed
from clouds import SECOND
from hypothesis import given
from hypothesis import strategies as st

from sonar_processing.scans.parameters import ScanMode


def test_stamps_are_negative_while_still_and_positive_while_moving():
    assembler = assembler_with(scan_size=2)
    assembler.add(placed(seconds=1, moving=False))
    assert assembler.add(placed(seconds=2, moving=True)).time_stamps.tolist() == [-1, -1, -1, 2, 2, 2]


def test_every_beam_is_placed_by_its_own_transform():
    assembler = assembler_with(scan_size=2)
    assembler.add(placed(shift=(1.0, 0.0, 0.0)))
    scan = assembler.add(placed(shift=(0.0, 5.0, -2.0)))
    np.testing.assert_allclose(
        scan.points[:, :3], [(1.5, 0, 0), (2.5, 0, 0), (3.5, 0, 0), (0.5, 5, -2), (1.5, 5, -2), (2.5, 5, -2)]
    )


def test_a_scan_has_the_stamp_of_its_newest_beam_and_the_target_frame():
    assembler = assembler_with(scan_size=2, target_frame="map")
    assembler.add(placed(seconds=7))
    scan = assembler.add(placed(seconds=8))
    assert (scan.stamp_ns, scan.frame_id) == (8 * SECOND, "map")


def test_beams_of_different_bin_counts_make_one_scan():
    assembler = assembler_with(scan_size=2)
    assembler.add(placed(strengths=(1, 2), seconds=1))
    scan = assembler.add(placed(strengths=(3, 4, 5, 6), seconds=2))
    assert scan.points[:, 3].tolist() == [1, 2, 3, 4, 5, 6]
    assert scan.time_stamps.tolist() == [-1, -1, -2, -2, -2, -2]


def test_bins_nearer_than_min_range_go_with_their_stamps():
    scan = assembler_with(scan_size=1, min_range=1.5).add(placed(strengths=(9, 8, 7, 6)))
    assert scan.points[:, 3].tolist() == [8, 7, 6]
    assert len(scan.time_stamps) == 3


def test_points_above_the_height_limit_go_with_their_stamps():
    assembler = assembler_with(scan_size=2, height_limit=-1.0)
    assembler.add(placed(seconds=1, shift=(0, 0, -0.5)))
    assert assembler.add(placed(seconds=2, shift=(0, 0, -1.0))).time_stamps.tolist() == [-2, -2, -2]


def test_a_scan_of_removed_points_only_is_an_empty_cloud():
    scan = assembler_with(scan_size=1, min_range=50.0).add(placed())
    assert len(scan) == len(scan.time_stamps) == 0


@given(
    st.lists(st.tuples(st.integers(1, 9), st.booleans()), min_size=1, max_size=8),
    st.integers(1, 15),
    st.floats(0.0, 5.0),
    st.sampled_from(list(ScanMode)),
    st.booleans(),
)
def test_every_point_has_the_stamp_of_its_own_beam(beams, sides, min_range, mode, organized):
    assembler = assembler_with(
        scan_size=len(beams), dispersed_points=sides, min_range=min_range, mode=mode, keep_organized=organized
    )
    for number, (bins, moving) in enumerate(beams, 1):
        # The strength of every echo tells which beam it is of.
        scan = assembler.add(placed(strengths=[number] * bins, seconds=number, moving=moving))
    signs = np.array([1.0 if moving else -1.0 for _, moving in beams])
    finite = scan.valid
    numbers = scan.points[finite, 3].astype(int)
    np.testing.assert_array_equal(scan.time_stamps[finite], numbers * signs[numbers - 1])


@pytest.mark.parametrize("sides", [2, 5])
def test_dispersed_points_multiply_the_points_and_their_stamps(sides):
    assembler = assembler_with(scan_size=2, dispersed_points=sides)
    assembler.add(placed(seconds=1))
    scan = assembler.add(placed(seconds=2))
    assert scan.time_stamps.tolist() == [-1.0] * (3 * sides) + [-2.0] * (3 * sides)
    assert scan.points[:, 3].tolist() == [10, 20, 30] * (2 * sides)


def test_min_range_holds_for_every_side_of_a_dispersed_beam():
    scan = assembler_with(scan_size=1, dispersed_points=3, min_range=1.0).add(placed())
    assert scan.points[:, 3].tolist() == [20, 30] * 3


def test_an_organised_scan_has_a_row_per_beam_and_nan_for_removed_points():
    assembler = assembler_with(scan_size=2, keep_organized=True, min_range=1.0)
    assembler.add(placed(seconds=1))
    scan = assembler.add(placed(seconds=2))
    assert (scan.height, len(scan)) == (2, 6)
    assert np.isnan(scan.points).all(axis=1).tolist() == [True, False, False] * 2
    assert scan.time_stamps.tolist() == [-1, -1, -1, -2, -2, -2]


def test_an_organised_scan_of_one_beam_keeps_its_bins():
    scan = assembler_with(scan_size=1, keep_organized=True, min_range=1.0).add(placed())
    assert scan.is_organized
    assert np.isnan(scan.points).all(axis=1).tolist() == [True, False, False]


def test_an_organised_laser_scan_has_a_point_per_beam():
    assembler = assembler_with(mode="LASER", scan_size=2, keep_organized=True)
    assembler.add(placed(strengths=(0, 0, 0)))
    scan = assembler.add(placed())
    assert (scan.height, len(scan)) == (2, 2)
    assert scan.valid.tolist() == [False, True]


def test_beams_of_different_bin_counts_cannot_be_organised():
    assembler = assembler_with(scan_size=2, keep_organized=True)
    assembler.add(placed(strengths=(1, 2)))
    assert assembler.add(placed(strengths=(1, 2, 3))).height == 1


def test_laser_keeps_the_strongest_echo_of_every_beam():
    assembler = assembler_with(mode="LASER", scan_size=2)
    assembler.add(placed(strengths=(10, 90, 20)))
    scan = assembler.add(placed(strengths=(5, 6, 70)))
    assert scan.points[:, [0, 3]].tolist() == [[1.5, 90], [2.5, 70]]


def test_laser_keeps_the_nearest_of_equal_echoes():
    assert assembler_with(mode="LASER", scan_size=1).add(placed(strengths=(0, 90, 90))).points[0, 0] == 1.5


def test_laser_looks_beyond_min_range_only():
    scan = assembler_with(mode="LASER", scan_size=1, min_range=1.0).add(placed(strengths=(120, 10, 20)))
    assert scan.points[:, 3].tolist() == [20]


def test_laser_has_no_point_where_there_is_no_echo():
    assembler = assembler_with(mode="LASER", scan_size=2)
    assembler.add(placed(strengths=(0, 0, 0), seconds=1))
    assert assembler.add(placed(strengths=(0, 7, 0), seconds=2)).time_stamps.tolist() == [-2]


def test_laser_points_lie_on_the_axis_of_a_dispersed_beam():
    scan = assembler_with(mode="LASER", scan_size=1, dispersed_points=5).add(placed())
    assert scan.points[:, :3].tolist() == [[2.5, 0.0, 0.0]]


def test_projecting_a_beam_shows_it_and_leaves_the_scan_alone():
    assembler = assembler_with(scan_size=2, min_range=1.0)
    shown = assembler.project(placed(seconds=1))
    assert shown.points[:, 3].tolist() == [20, 30]
    assert assembler.add(placed(seconds=2)) is None
