"""Messages of other packages as plain objects, stamped as rospy or as rosbags has it."""

from types import SimpleNamespace

import numpy as np

SECOND = 10**9
STAMP_NS = 1_400_000_000 * SECOND + 123_456_789


def header(stamp_ns=STAMP_NS, frame_id="sonar", as_rosbags=False):
    """Return a header as rospy or as the library rosbags gives it."""
    seconds, rest = divmod(stamp_ns, SECOND)
    stamp = {"sec": seconds, "nanosec": rest} if as_rosbags else {"secs": seconds, "nsecs": rest}
    return SimpleNamespace(stamp=SimpleNamespace(**stamp), frame_id=frame_id)


def _made(values, **defaults):
    return SimpleNamespace(**{**defaults, **values})


def scan_line_of(**values):
    """Return a SonarScanLine."""
    return _made(
        values, header=header(), angle=0.5, intensities=bytes([1, 2, 255]), maxrange_meters=50.0, range_resolution=0.25,
        gain=20, sensorAngle=-0.125,
    )  # fmt: skip


def sonar_echo_of(angle=0.5, **values):
    """Return a SonarEcho of ping360_sonar."""
    return _made(
        values, header=header(frame_id="sonar_frame"), angle=angle, gain=1, number_of_samples=4, transmit_frequency=740,
        speed_of_sound=1480, range=20, intensities=bytes([0, 10, 200, 3]),
    )  # fmt: skip


def ping_360_of(angle=100, **values):
    """Return a SonarPing360 of bluerobotics_sonar."""
    return _made(
        values, header=header(frame_id="ping360"), distance=1.0, mode=1, gain_setting=0, angle=angle,
        transmit_duration=32, sample_period=88, transmit_frequency=750, range=2.0,
        profile_data=np.array([5, 6, 7, 8], dtype=np.uint8),
    )  # fmt: skip


def micron_line_of(angle=-180.0, strengths=(1, 2, 3), step=0.05, **values):
    """Return a ScanLine of micron_driver_ros."""
    bins = [SimpleNamespace(distance=step * (i + 1), intensity=one) for i, one in enumerate(strengths)]
    return _made(values, header=header(frame_id="/Micron"), angle=angle, bin_distance_step=step, bins=bins)


def point_cloud_of(strengths=(1, 2, 3), bearing=-0.5 * np.pi, step=0.05, **values):
    """Return a PointCloud of tritech_micron."""
    reach = step * np.arange(1, len(strengths) + 1)
    points = [SimpleNamespace(x=one * np.cos(bearing), y=one * np.sin(bearing), z=0.0) for one in reach]
    channels = [SimpleNamespace(name="intensity", values=[float(one) for one in strengths])]
    return _made(values, header=header(), points=points, channels=channels)


def laser_scan_of(ranges=(1.0, np.inf, 3.0), **values):
    """Return a LaserScan."""
    return _made(
        values, header=header(), angle_min=-1.0, angle_increment=0.5, time_increment=0.1, range_max=50.0,
        ranges=np.array(ranges, dtype=np.float32), intensities=[],
    )  # fmt: skip


def sonar_image_data_of(strengths=(1, 2, 3), **values):
    """Return a SonarImageData of marine_acoustic_msgs with one beam."""
    return _made(values, is_bigendian=False, dtype=0, beam_count=1, data=np.array(strengths, dtype=np.uint8))


def raw_sonar_image_of(angle=0.5, **values):
    """Return a RawSonarImage of marine_acoustic_msgs with bins of 0.05 m, the first of which it leaves out."""
    return _made(
        values, header=header(), ping_info=SimpleNamespace(sound_speed=1480.0), sample_rate=14800.0, sample0=1,
        rx_angles=np.array([angle]), image=sonar_image_data_of(),
    )  # fmt: skip


def projected_sonar_image_of(angle=0.5, **values):
    """Return a ProjectedSonarImage of marine_acoustic_msgs with bins of 0.05 m, the first of which it leaves out."""
    direction = SimpleNamespace(x=0.0, y=-np.sin(angle), z=np.cos(angle))
    return _made(
        values, header=header(), ping_info=SimpleNamespace(sound_speed=1480.0), beam_directions=[direction],
        ranges=np.array([0.075, 0.125, 0.175], dtype=np.float32), image=sonar_image_data_of(),
    )  # fmt: skip


def turning_image_of(columns=(), **values):
    """Return an image of Stonefish's MSIS with 8 steps and 3 bins; columns: strengths from the nearest bin on."""
    image = np.zeros((3, 8), dtype=np.uint8)
    for column, strengths in dict(columns).items():
        image[:, column] = strengths[::-1]
    return _made(values, header=header(), height=3, width=8, step=8, encoding="mono8", data=image.tobytes())
