"""Logs of an autopilot as the motion, and the offset of its clock from the echoes."""

import struct

import numpy as np
import pytest
from made_recordings import wandering

from georeferencing.fixes import UNKNOWN_DEVIATION, Fix
from recordings.bags.bag import RecordingError
from recordings.beams import RecordedBeams
from recordings.motion.autopilot_log import fixes_of_autopilot, is_autopilot_log, motion_of_autopilot
from recordings.motion.clock_offset import clock_offset
from recordings.motion.pose_track import PoseTrack
from recordings.motion.vehicle_motion import MotionNames, MotionSource
from recordings.reader import Request, read

START = 1_700_000_000
AFTER = 600.0  # s: the motion begins so long after the clock of the beams, which then can be ahead
YAWS = np.linspace(0.1, 1.5, 20)


def track_of(recording):
    times, poses = recording.track.times, recording.track.poses
    level, half = np.zeros((len(times), 2)), poses[:, 2] / 2.0
    turns = np.column_stack([level, np.sin(half), np.cos(half)])
    return PoseTrack(
        np.round((AFTER + times) * 1e9).astype(np.int64), np.column_stack([poses[:, :2], level[:, :1]]), turns
    )


@pytest.mark.long
@pytest.mark.parametrize("seconds", [0.0, -1.0, 20.0, -300.0])
def test_the_echoes_tell_how_far_the_clocks_are_apart(seconds):
    made = wandering()
    beams = RecordedBeams([placed.beam for placed in made.beams], []).later(AFTER - seconds).beams
    found, deviation = clock_offset(beams, track_of(made), np.eye(4))
    assert found == pytest.approx(seconds, abs=0.3)
    assert deviation < 0.3


def test_no_offset_is_told_where_the_vehicle_stood_or_the_turns_are_few(monkeypatch):
    monkeypatch.setattr("recordings.motion.clock_offset._FARTHEST", 20.0)
    made = wandering()
    beams = [placed.beam for placed in made.beams]
    with pytest.raises(RecordingError, match="give --offset"):
        clock_offset(beams, PoseTrack.fixed(np.zeros(3), [0.0, 0.0, 0.0, 1.0]), np.eye(4))
    with pytest.raises(RecordingError, match="3 turns or sweeps"):
        clock_offset(beams[:350], track_of(made), np.eye(4))


def telemetry(path, positions):
    """Write a .tlog with an attitude and a place, north, east, down [m], each second; and those of a second vehicle."""
    dialect = pytest.importorskip("pymavlink.dialects.v20.ardupilotmega")
    ours, other = (dialect.MAVLink(None, srcSystem=number) for number in (1, 2))
    with path.open("wb") as file:
        for second, (yaw, place) in enumerate(zip(YAWS, positions)):
            messages = [
                ours.attitude_encode(0, 0.0, 0.0, yaw, 0.0, 0.0, 0.0).pack(ours),
                ours.local_position_ned_encode(0, *map(float, place), 0.0, 0.0, 0.0).pack(ours),
                ours.vfr_hud_encode(0.0, 0.0, 0, 0, -float(place[2]), 0.0).pack(ours),
                ours.gps_raw_int_encode(
                    0, 3 if second < 2 else 1, 412000000 + second, -31000000, 0, 100, 100, 0, 0, 8, h_acc=1500 * second
                ).pack(ours),
            ]
            messages += [other.attitude_encode(0, 0.0, 0.0, 3.0, 0.0, 0.0, 0.0).pack(other)] * (second == 5)
            for message in messages:
                file.write(struct.pack(">Q", (START + second) * 10**6) + message)
        file.write(b"cut off")


@pytest.mark.parametrize(("speed", "source"), [(0.5, MotionSource.POSES), (0.0, MotionSource.HEADING)])
def test_telemetry_holds_poses_or_where_positions_stay_a_heading_and_a_depth(tmp_path, speed, source):
    path = tmp_path / "dive.tlog"
    north = speed * np.arange(20.0)
    telemetry(path, np.column_stack([north, 2.0 * north, np.full(20, 3.0)]))
    motion = motion_of_autopilot(path, MotionNames())
    assert motion.source is source
    first, second = fixes_of_autopilot(path)
    assert second == Fix(START + 1, pytest.approx(41.2000001, abs=1e-9), pytest.approx(-3.1), (1.5, 1.5))
    assert first.deviations == (UNKNOWN_DEVIATION, UNKNOWN_DEVIATION)
    track = motion.tree.tracks[("odom", "base_link")]
    np.testing.assert_array_equal(track.stamps_ns, (START + np.arange(20)) * 10**9)
    np.testing.assert_allclose(track.translations, np.column_stack([north, -2.0 * north, np.full(20, -3.0)]), atol=1e-5)
    np.testing.assert_allclose(2.0 * np.arctan2(*track.rotations[:, 2:].T), -YAWS, atol=1e-6)


def test_an_autopilot_s_log_in_place_of_a_recording_is_named_with_what_to_do(tmp_path):
    (tmp_path / "dive.tlog").write_bytes(b"")
    with pytest.raises(RecordingError, match="--vehicle"):
        read(tmp_path / "dive.tlog", Request())


def test_a_log_without_an_attitude_or_none_at_all_is_refused(tmp_path):
    pytest.importorskip("pymavlink")
    path = tmp_path / "empty.tlog"
    with pytest.raises(RecordingError, match="No such file"):
        motion_of_autopilot(path, MotionNames())
    path.write_bytes(b"nothing of this is MAVLink" * 10)
    with pytest.raises(RecordingError, match="no attitude"):
        motion_of_autopilot(path, MotionNames())


def test_a_dataflash_log_is_told_from_ping_viewer_s(tmp_path):
    for name, start in (("flash.BIN", b"\xa3\x95\x80"), ("viewer.bin", b"\0\0\0\x34")):
        (tmp_path / name).write_bytes(start)
    known = [is_autopilot_log(tmp_path / name) for name in ("flash.BIN", "viewer.bin", "none.bin")]
    assert known == [True, False, False]


def test_a_dataflash_log_gives_degrees_as_radians_and_the_first_estimator_s_positions(tmp_path):
    pytest.importorskip("pymavlink")
    path = tmp_path / "00000001.BIN"
    path.write_bytes(dataflash())
    motion = motion_of_autopilot(path, MotionNames())
    track = motion.tree.tracks[("odom", "base_link")]
    assert motion.source is MotionSource.POSES
    np.testing.assert_allclose(track.translations[:, 0], np.arange(20.0), atol=1e-5)
    np.testing.assert_allclose(
        2.0 * np.arctan2(*track.rotations[:, 2:].T), -np.radians(np.round(np.degrees(YAWS), 2)), atol=1e-6
    )


def dataflash():
    """Return a log with its formats, an attitude each second, and positions of two estimators."""
    kinds = {
        128: (b"FMT", b"BBnNZ", "<BB4s16s64s", b"Type,Length,Name,Format,Columns"),
        129: (b"ATT", b"Qccc", "<Qhhh", b"TimeUS,Roll,Pitch,Yaw"),
        130: (b"XKF1", b"QBfff", "<QBfff", b"TimeUS,C,PN,PE,PD"),
    }

    def packed(number, *values):
        return b"\xa3\x95" + bytes([number]) + struct.pack(kinds[number][2], *values)

    out = b""
    for number, (name, pack, form, fields) in kinds.items():
        out += packed(128, number, 3 + struct.calcsize(form), name, pack, fields)
    for second, yaw in enumerate(YAWS):
        micros = (second + 1) * 10**6
        out += packed(129, micros, 0, 0, round(float(np.degrees(yaw)) * 100))
        out += packed(130, micros, 0, second, 2.0 * second, 3.0)
        out += packed(130, micros, 1, 99.0, 99.0, 99.0)
    return out
