"""Recordings as the programs and drivers of the sonars' makers write them."""

import numpy as np
import pytest

from recordings.motion.vehicle_motion import MotionNames, MotionSource
from recordings.reader import Request, read

STANDING = Request(motion=MotionNames(declared=MotionSource.STANDING))
LOGS = {
    "1.bin": 1325,
    "20210611-215610861.bin": 401,
    "20210829-000142103.bin": 192,
    "20210829-001137890-8.bin": 153,
    "20210829-002023975.bin": 1989,
    "20210829-004648350-19.bin": 362,
    "20240814-094253162.bin": 145,
    "fish_farm_test2.bin": 2884,
}


@pytest.mark.parametrize(("name", "beams"), LOGS.items())
def test_every_beam_of_ping_viewer_s_logs_is_read_in_the_order_of_its_time(recording, name, beams):
    content = read(recording(f"ping360_logs/{name}"), STANDING)
    assert len(content.recorded.beams) == beams
    assert (np.diff(content.recorded.stamps_ns) >= 0).all()


def test_the_clouds_of_tritech_micron_are_the_beams_that_were_made_of_them(recording):
    clouds, lines = (
        read(recording(name), STANDING).recorded.beams for name in ("tritech_micron_native.bag", "micron_static.bag")
    )
    assert len(clouds) == len(lines)
    for cloud, line in zip(clouds, lines):
        np.testing.assert_array_equal(cloud.intensities, line.intensities)
        assert np.exp(1j * cloud.angle) == pytest.approx(np.exp(1j * line.angle), abs=1e-4)
        assert cloud.range_resolution == pytest.approx(line.range_resolution, abs=1e-6)
