"""Which beams make a scan, and what it holds: its points, their stamps and its own."""

import math

import numpy as np
import pytest
from clouds import SECOND, assembler_with, placed
from hypothesis import given
from hypothesis import strategies as st

from sonar_processing.scans.parameters import ScanMode

STEP = math.radians(3.0)


def _scans(beams, **values):
    """Return what an assembler with these parameters makes of each beam, given as `placed` takes it."""
    assembler = assembler_with(**values)
    return [assembler.add(placed(**beam)) for beam in beams]


def _seconds(scan):
    """Return the stamps of the beams in a scan, s."""
    return np.unique(np.abs(scan.time_stamps)).tolist()


def _scan_ends(angles, **values):
    """Return after how many beams each scan came, for a head that passes through `angles`."""
    scans = _scans([{"angle": angle} for angle in angles], **{"scan_size": 3600, **values})
    return [count for count, scan in enumerate(scans, 1) if scan is not None]


def test_a_scan_ends_after_scan_size_beams():
    assert _scan_ends(np.zeros(7), scan_size=3) == [3, 6]


@pytest.mark.parametrize("direction", [1, -1])
@pytest.mark.parametrize("start", [0.0, 0.5, math.pi, -math.pi, 100.0])
def test_a_scan_ends_before_the_head_passes_its_start_again(direction, start):
    angles = start + direction * STEP * np.arange(360)
    assert _scan_ends(angles) == _scan_ends(np.arctan2(np.sin(angles), np.cos(angles))) == [120, 240, 360]


SWING = np.concatenate([np.arange(60), np.arange(60, 0, -1)] * 5) * STEP


@pytest.mark.parametrize(
    ("angles", "values", "ends"),
    [
        *((np.delete(STEP * np.arange(240), missed), {}, [119, 239]) for missed in (1, 60, 118)),
        (SWING, {}, []),
        (np.full(500, 1.0), {}, []),
        (STEP * np.arange(500), {"end_at_full_turn": False}, []),
    ],
    ids=["2nd missed", "61st missed", "119th missed", "swinging sector", "standing head", "turns that end nothing"],
)
def test_only_whole_turns_end_a_scan_though_a_beam_is_missed(angles, values, ends):
    assert _scan_ends(angles, **values) == ends


@pytest.mark.parametrize("lost", [[119], [118, 119], [100, 117, 118, 119]])
@pytest.mark.parametrize("direction", [1, -1])
def test_the_first_beam_of_a_turn_ends_the_one_before_whose_last_beams_were_lost(lost, direction):
    angles = np.delete(direction * STEP * np.arange(240), lost)
    scans = _scans([{"angle": angle, "seconds": number} for number, angle in enumerate(angles, 1)], scan_size=3600)
    assert [len(_seconds(scan)) for scan in scans if scan is not None] == [120 - len(lost), 120]


def test_the_continuous_modes_go_on_over_the_end_of_a_turn():
    assert len(_scans([{"angle": count * STEP} for count in range(250)], mode="LASERCONT", scan_size=200)[-1]) == 200


def test_steps_that_vary_still_make_a_full_turn():
    steps = STEP * (1.0 + 0.1 * np.sin(np.arange(400)))
    lengths = np.diff([0, *_scan_ends(np.cumsum(steps))])
    assert len(lengths) == 3
    assert all(abs(length - 120) <= 2 for length in lengths)


def _tilted(*tilts):
    """Return beams of these tilts of the servo [rad], one a second."""
    return [{"seconds": seconds, "sensor_angle": tilt} for seconds, tilt in enumerate(tilts, 1)]


def test_a_servo_step_ends_the_scan_before_the_beam_that_saw_it():
    *before, scan = _scans(_tilted(0.1, 0.1, 0.2))
    assert (before, _seconds(scan), scan.stamp_ns) == ([None, None], [1, 2], 2 * SECOND)


def test_the_beam_after_a_servo_step_begins_the_next_scan():
    assert _seconds(_scans(_tilted(0.1, 0.2, 0.2), scan_size=2)[-1]) == [2, 3]


def test_a_servo_that_trembles_ends_nothing():
    assert _scans(_tilted(*[0.0, 0.0005] * 10)) == [None] * 20


@pytest.mark.parametrize(("mode", "per_beam"), [("SONARCONT", 3), ("LASERCONT", 1)])
def test_continuous_modes_give_the_newest_scan_size_beams_from_the_first_whole_scan_on(mode, per_beam):
    first, second, *scans = _scans([{"seconds": seconds} for seconds in range(1, 6)], mode=mode, scan_size=3)
    assert (first, second) == (None, None)
    assert [_seconds(scan) for scan in scans] == [[1, 2, 3], [2, 3, 4], [3, 4, 5]]
    assert [len(scan) for scan in scans] == [3 * per_beam] * 3


def test_a_servo_step_empties_the_continuous_scan():
    _, second, scan = _scans(_tilted(0.1, 0.2, 0.2), mode="SONARCONT", scan_size=2)
    assert (second, _seconds(scan)) == (None, [2, 3])


def test_clear_forgets_the_unfinished_scan():
    assembler = assembler_with(scan_size=2)
    assembler.add(placed(seconds=1))
    assembler.clear()
    assert assembler.add(placed(seconds=2)) is None
    assert _seconds(assembler.add(placed(seconds=3))) == [2, 3]


def test_clear_forgets_how_far_the_head_has_turned():
    assembler = assembler_with()
    for count in range(119):
        assembler.add(placed(angle=count * STEP))
    assembler.clear()
    assert assembler.add(placed(angle=119 * STEP)) is None
    assert assembler.add(placed(angle=120 * STEP)) is None


def test_clear_forgets_the_servo():
    assembler = assembler_with()
    assembler.add(placed(sensor_angle=0.1))
    assembler.clear()
    assert assembler.add(placed(sensor_angle=0.9)) is None


def test_an_unfinished_scan_before_a_silence_is_forgotten():
    *before, scan = _scans([{"seconds": seconds} for seconds in (1, 100, 101, 102)], scan_size=3)
    assert (before, _seconds(scan)) == ([None] * 3, [100, 101, 102])


def _scan_of(*beams, **values):
    """Return the scan of these beams, which by default come one a second."""
    return _scans([{"seconds": s, **beam} for s, beam in enumerate(beams, 1)], scan_size=len(beams), **values)[-1]


def test_every_beam_is_placed_by_its_own_transform():
    scan = _scan_of({"shift": (1.0, 0.0, 0.0)}, {"shift": (0.0, 5.0, -2.0)})
    np.testing.assert_allclose(
        scan.points[:, :3], [(1.5, 0, 0), (2.5, 0, 0), (3.5, 0, 0), (0.5, 5, -2), (1.5, 5, -2), (2.5, 5, -2)]
    )


def test_a_scan_has_the_stamp_of_its_newest_beam_and_the_target_frame():
    scan = _scan_of({}, {}, target_frame="map")
    assert (scan.stamp_ns, scan.frame_id) == (2 * SECOND, "map")


def test_beams_of_different_bin_counts_make_one_scan():
    scan = _scan_of({"strengths": (1, 2)}, {"strengths": (3, 4, 5, 6)})
    assert scan.points[:, 3].tolist() == [1, 2, 3, 4, 5, 6]
    assert scan.time_stamps.tolist() == [-1, -1, -2, -2, -2, -2]


def test_points_above_the_height_limit_go_with_their_stamps():
    scan = _scan_of({"shift": (0, 0, -0.5)}, {"shift": (0, 0, -1.0)}, height_limit=-1.0)
    assert scan.time_stamps.tolist() == [-2, -2, -2]


def test_a_scan_of_removed_points_only_is_an_empty_cloud():
    scan = _scan_of({}, min_range=50.0)
    assert len(scan) == len(scan.time_stamps) == 0


@given(
    st.lists(st.tuples(st.integers(1, 9), st.booleans()), min_size=1, max_size=8),
    st.integers(1, 15),
    st.floats(0.0, 5.0),
    st.sampled_from(list(ScanMode)),
    st.booleans(),
)
def test_every_point_has_the_stamp_of_its_own_beam_negative_while_the_vehicle_was_still(
    beams, sides, min_range, mode, organized
):
    # The strength of every echo tells which beam it is of.
    made = [{"strengths": [number] * bins, "moving": moving} for number, (bins, moving) in enumerate(beams, 1)]
    scan = _scan_of(*made, dispersed_points=sides, min_range=min_range, mode=mode, keep_organized=organized)
    signs = np.array([1.0 if moving else -1.0 for _, moving in beams])
    numbers = scan.points[scan.valid, 3].astype(int)
    np.testing.assert_array_equal(scan.time_stamps[scan.valid], numbers * signs[numbers - 1])


@pytest.mark.parametrize("sides", [2, 5])
def test_dispersed_points_multiply_the_points_and_their_stamps(sides):
    scan = _scan_of({}, {}, dispersed_points=sides)
    assert scan.time_stamps.tolist() == [-1.0] * (3 * sides) + [-2.0] * (3 * sides)
    assert scan.points[:, 3].tolist() == [10, 20, 30] * (2 * sides)


def test_min_range_holds_for_every_side_of_a_dispersed_beam():
    assert _scan_of({}, dispersed_points=3, min_range=1.0).points[:, 3].tolist() == [20, 30] * 3


@pytest.mark.parametrize("beams", [1, 2])
def test_an_organised_scan_has_a_row_per_beam_and_nan_for_removed_points(beams):
    scan = _scan_of(*[{}] * beams, keep_organized=True, min_range=1.0)
    assert (scan.organized, scan.height) == (True, beams)
    assert np.isnan(scan.points).all(axis=1).tolist() == [True, False, False] * beams
    assert scan.time_stamps.tolist() == [-1, -1, -1, -2, -2, -2][: 3 * beams]


def test_an_organised_laser_scan_has_a_point_per_beam():
    scan = _scan_of({"strengths": (0, 0, 0)}, {}, mode="LASER", keep_organized=True)
    assert (scan.height, scan.valid.tolist()) == (2, [False, True])


def test_beams_of_different_bin_counts_cannot_be_organised():
    assert _scan_of({"strengths": (1, 2)}, {"strengths": (1, 2, 3)}, keep_organized=True).height == 1


@pytest.mark.parametrize(
    ("strengths", "values", "points"),
    [
        ((10, 90, 20), {}, [[1.5, 0.0, 0.0, 90.0]]),
        ((0, 90, 90), {}, [[1.5, 0.0, 0.0, 90.0]]),
        ((120, 10, 20), {"min_range": 1.0}, [[2.5, 0.0, 0.0, 20.0]]),
        ((0, 0, 0), {}, []),
        ((10, 20, 30), {"dispersed_points": 5}, [[2.5, 0.0, 0.0, 30.0]]),
    ],
    ids=["the strongest", "of equal ones the nearest", "beyond min_range", "no echo", "on the axis of a wide beam"],
)
def test_laser_keeps_one_echo_of_every_beam(strengths, values, points):
    assert _scan_of({"strengths": strengths}, mode="LASER", **values).points.tolist() == points


def test_projecting_a_beam_shows_it_and_leaves_the_scan_alone():
    assembler = assembler_with(scan_size=2, min_range=1.0)
    shown = assembler.project(placed(seconds=1))
    assert shown.points[:, 3].tolist() == [20, 30]
    assert assembler.add(placed(seconds=2)) is None
