"""Recordings of Ping Viewer Next, written as its source says: JSON messages in an MCAP file."""

import json

import numpy as np
import pytest
from mcap.writer import CompressionType, Writer

from mlsm_manager.offline.charts import satellite_fixes
from recordings.bags.bag import RecordingError
from recordings.makers_logs import is_makers_log
from recordings.motion.vehicle_motion import MotionSource
from recordings.reader import Request, read

SECOND = 10**9
START = 1_700_000_000 * SECOND
BEAM = {
    "mode": 1, "gain_setting": 1, "transmit_duration": 32, "sample_period": 400, "transmit_frequency": 750,
    "start_angle": 0, "stop_angle": 399, "num_steps": 1, "delay": 0, "number_of_samples": 300, "data_length": 300,
}  # fmt: skip


def write(path, with_vehicle=True, beams=400, device="0a", topic="Ping360", places=(), **changes):
    """Write a turn of a head on a vehicle that turns from north to east."""
    with path.open("wb") as file:
        writer = Writer(file, chunk_size=50_000, compression=CompressionType.NONE)
        writer.start(profile="", library="foxglove-sdk-rs/0.9.0")
        schema = writer.register_schema("any", "jsonschema", b"{}")
        names = (f"/device_{device}/{topic}", f"/device_{device}/VehicleData")
        channels = [writer.register_channel(name, "json", schema) for name in names]
        for index in range(beams):
            time = START + index * SECOND // 20
            contents = [{**BEAM, "angle": index % 400, "data": [index % 256] * 300, **changes}]
            yaw = np.pi / 2.0 * index / beams
            place = dict(zip(("alt", "lat", "lon"), places[index])) if places else {}
            contents += [{"roll": 0.0, "pitch": 0.1, "yaw": yaw, **place}] * with_vehicle
            for channel, content in zip(channels, contents):
                writer.add_message(channel, time, json.dumps(content).encode(), time)
        writer.finish()
    return path


@pytest.fixture
def turn(tmp_path):
    return write(tmp_path / "device_0a.mcap")


def test_beams_and_headings_come_from_one_file(turn):
    assert is_makers_log(turn)
    found = read(turn, Request())
    assert (len(found.recorded.beams), found.recorded.refused) == (400, 0)
    beam = found.recorded.beams[100]
    assert beam.stamp_ns == pytest.approx(START + 5 * SECOND - 0.003 * SECOND, abs=1e6)
    assert (beam.angle, beam.intensities[0]) == (pytest.approx(np.pi / 2), 100)
    assert found.motion.source is MotionSource.HEADING
    poses = found.motion.tree.tracks["odom", "base_link"].at(found.recorded.stamps_ns)
    yaws = np.arctan2(poses[:, 1, 0], poses[:, 0, 0])
    assert (yaws[1], yaws[-1]) == (pytest.approx(0.0, abs=0.01), pytest.approx(-np.pi / 2, abs=0.01))
    assert np.arcsin(-poses[200, 2, 0]) == pytest.approx(-0.1, abs=1e-3)  # Nose up


def test_positions_while_at_the_surface_are_fixes_of_satellites(tmp_path):
    """In a lake 200 m above the sea; the estimator begins without a position, and dives after the third."""
    places = [(200.0, 0.0, 0.0), (200.2, 41.0, 3.0), (199.9, 41.00001, 3.0), (195.0, 41.1, 3.0)]
    fixes = satellite_fixes(write(tmp_path / "a.mcap", beams=4, places=places))
    assert [(fix.latitude_deg, fix.longitude_deg) for fix in fixes] == [(41.0, 3.0), (41.00001, 3.0)]
    assert fixes[0].time == pytest.approx((START + SECOND // 20) / SECOND)


def test_without_the_vehicle_nothing_is_said_of_the_motion(tmp_path):
    found = read(write(tmp_path / "a.mcap", with_vehicle=False), Request())
    assert found.motion.source is MotionSource.UNSAID


def test_a_file_that_was_cut_off_is_read_as_far_as_it_goes(turn):
    turn.write_bytes(turn.read_bytes()[: 2 * turn.stat().st_size // 3])
    beams = read(turn, Request()).recorded.beams
    assert 100 < len(beams) < 400


@pytest.mark.parametrize("changes", [{"data": "text"}, {"angle": 4000}, {"sample_period": None}, {"data": [999]}])
def test_what_is_no_beam_is_refused_and_counted(tmp_path, changes):
    with pytest.raises(RecordingError, match="5 were not readable"):
        read(write(tmp_path / "a.mcap", beams=5, **changes), Request())


def test_another_mcap_file_is_refused_with_its_topics(tmp_path):
    path = write(tmp_path / "a.mcap", with_vehicle=False, beams=2, topic="camera")
    with pytest.raises(RecordingError, match="its topics are /device_0a/camera"):
        read(path, Request())
