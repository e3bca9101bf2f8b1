#!/usr/bin/env python3
"""Ray scans of three types, from a sensor that sees the whole circle and from one that a joint turns, become beams."""

import math
import unittest

import numpy as np
import rospy
import tf2_ros
from geometry_msgs.msg import Point32
from graph import Diagnostics, Inbox, end_publishing, run, wait_for_publisher_links
from messages import publisher, transform
from sensor_msgs.msg import ChannelFloat32, JointState, LaserScan, PointCloud, PointCloud2, PointField
from std_msgs.msg import Header, String

from underwater_map_construction.msg import SonarScanLine

FULL_CIRCLE = 2.0 * math.pi
WALL = 12.0
BEAM = math.radians(2.5)
MOST_SCANS = 1200  # ten turns


# Messages as Gazebo's ray sensor plugins lay them out, of a sensor in front of a wall across its x axis.
RANGE_MIN = 0.1
RANGE_MAX = 50.1
ROWS = 9
VERTICAL = np.radians(np.linspace(-11.0, 11.0, ROWS))


def _ranges(bearings: np.ndarray, wall: float) -> np.ndarray:
    """Return distances (rows, columns), m; beyond the greatest range where the wall is not."""
    with np.errstate(divide="ignore"):
        distances = wall / (np.cos(VERTICAL)[:, np.newaxis] * np.cos(bearings))
    return np.where((distances > 0.0) & (distances < RANGE_MAX), distances, np.inf)


def laser_scan(header: Header, opening: float, columns: int, wall: float) -> LaserScan:
    """As gazebo_ros_laser: all rows one after the other, inf where nothing is hit, no word of the rows."""
    bearings = np.linspace(-opening / 2, opening / 2, columns)
    ranges = _ranges(bearings, wall).ravel()
    return LaserScan(
        header=header,
        angle_min=-opening / 2,
        angle_max=opening / 2,
        angle_increment=opening / (columns - 1),
        range_min=RANGE_MIN,
        range_max=RANGE_MAX,
        ranges=ranges.tolist(),
        intensities=[0.0] * len(ranges),
    )


def _points(opening: float, columns: int, wall: float) -> np.ndarray:
    """As gazebo_ros_block_laser: points at the greatest range less the smallest where nothing is hit, z upside down."""
    bearings = np.linspace(-opening / 2, opening / 2, columns)
    ranges = np.minimum(_ranges(bearings, wall), RANGE_MAX - RANGE_MIN)
    level = ranges * np.cos(VERTICAL)[:, np.newaxis]
    down = -ranges * np.sin(VERTICAL)[:, np.newaxis]
    return np.stack([level * np.cos(bearings), level * np.sin(bearings), down], axis=-1).reshape(-1, 3)


def block_laser(header: Header, opening: float, columns: int, wall: float) -> PointCloud:
    """As gazebo_ros_block_laser: one channel without a name."""
    points = _points(opening, columns, wall)
    channel = ChannelFloat32(values=[0.0] * len(points))
    return PointCloud(header=header, points=[Point32(*point) for point in points.tolist()], channels=[channel])


def cloud2(header: Header, opening: float, columns: int, wall: float) -> PointCloud2:
    """As plugins that publish PointCloud2: x, y, z, intensity and the ring, unordered, 22 bytes a point."""
    points = _points(opening, columns, wall).astype(np.float32)
    row = np.dtype({"names": ["xyz", "intensity", "ring"], "formats": ["3<f4", "<f4", "<u2"], "offsets": [0, 16, 20],
                    "itemsize": 22})  # fmt: skip
    rows = np.zeros(len(points), dtype=row)
    rows["xyz"] = points
    fields = [PointField(name, offset, PointField.FLOAT32, 1) for name, offset in (("x", 0), ("y", 4), ("z", 8))]
    fields += [PointField("intensity", 16, PointField.FLOAT32, 1), PointField("ring", 20, PointField.UINT16, 1)]
    return PointCloud2(
        header=header,
        height=1,
        width=len(rows),
        fields=fields,
        point_step=22,
        row_step=22 * len(rows),
        data=rows.tobytes(),
        is_dense=True,
    )


def header(seconds: float, frame_id: str) -> Header:
    """Return a header of some seconds after the Epoch."""
    return Header(stamp=rospy.Time.from_sec(seconds), frame_id=frame_id)


def _strongest(beam: SonarScanLine) -> float:
    """Return the range of a beam's middle of strength, m."""
    strengths = np.frombuffer(beam.intensities, dtype=np.uint8).astype(float)
    return float(np.average(np.arange(len(strengths)) + 0.5, weights=strengths**2)) * beam.range_resolution


class GazeboSonar(unittest.TestCase):
    """The wall stands 12 m ahead."""

    @classmethod
    def setUpClass(cls) -> None:
        cls.diagnostics = Diagnostics()
        cls.swept, cls.turned = Inbox("/sonar/raw", SonarScanLine), Inbox("/turning/sonar/raw", SonarScanLine)
        for inbox in (cls.swept, cls.turned):
            inbox.wait_for_link()

    def _beam_of(self, rays: rospy.Publisher, message: object) -> SonarScanLine:
        rays.publish(message)
        return self.swept.wait_for(lambda beam: beam.header.stamp == message.header.stamp)

    def _sweep_until_the_joint_is_known(self) -> None:
        """Send scans until a beam straight ahead is tilted: the joint state may come after some scans."""
        rays = publisher("/sonar/rays", LaserScan)
        for number in range(MOST_SCANS):
            beam = self._beam_of(rays, laser_scan(header(1.0 + 0.01 * number, "sonar"), FULL_CIRCLE, 721, WALL))
            if beam.sensorAngle != 0.0 and abs(beam.angle) < BEAM / 2:
                end_publishing(rays)
                return
        raise AssertionError(f"no joint state in {MOST_SCANS} scans")

    def test_a_full_circle_of_each_type_gives_one_beam_after_the_other(self) -> None:
        joints = publisher("/joint_states", JointState)
        joints.publish(JointState(name=["sonar_servo_joint"], position=[0.25]))
        self._sweep_until_the_joint_is_known()
        kinds = ((LaserScan, laser_scan), (PointCloud, block_laser), (PointCloud2, cloud2))
        for number, (kind, make) in enumerate(kinds, 1):
            rays = publisher("/sonar/rays", kind)
            message = make(header(100.0 + number, "sonar"), FULL_CIRCLE, 721, WALL)
            beam = self._beam_of(rays, message)
            self.assertAlmostEqual(beam.angle, math.radians(3.0 * number), places=6)
            self.assertAlmostEqual(_strongest(beam), WALL / math.cos(beam.angle), delta=0.6)
            self.assertEqual((beam.header.frame_id, len(beam.intensities), beam.maxrange_meters), ("sonar", 500, 50.0))
            self.assertAlmostEqual(beam.sensorAngle, 0.25, places=6)
            end_publishing(rays)

    def test_a_sensor_on_a_joint_gives_beams_where_tf_says_it_looks(self) -> None:
        """Also when tf comes after the scan."""
        start = float(round(rospy.get_time()))
        rays, transforms = publisher("/turning/sonar/rays", PointCloud), tf2_ros.StaticTransformBroadcaster()
        # The scan waits a few seconds for its transform, and a new connection may take as long on a busy machine.
        wait_for_publisher_links(transforms.pub_tf, 1)
        rays.publish(block_laser(header(start, "sonar_head"), BEAM, 5, WALL))
        transforms.sendTransform(transform("sonar", "sonar_head", yaw=-1.2))
        beam = self.turned.wait_for()
        self.assertAlmostEqual(beam.angle, -1.2, places=6)
        self.assertAlmostEqual(_strongest(beam), WALL, delta=0.5)
        self.assertEqual((beam.header.frame_id, beam.header.stamp.to_sec()), ("sonar", start))

    def test_scans_that_cannot_be_used_are_counted_and_the_node_goes_on(self) -> None:
        scan = laser_scan(header(200.0, "sonar"), FULL_CIRCLE, 721, WALL)
        cut = cloud2(header(201.0, "sonar"), FULL_CIRCLE, 721, WALL)
        cut.data = cut.data[:-5]
        nan = block_laser(header(202.0, "sonar"), FULL_CIRCLE, 721, WALL)
        nan.points[3].x = math.nan
        away = laser_scan(header(203.0, "sonar"), BEAM, 5, WALL)
        away.angle_min, away.angle_max = 1.0, 1.0 + BEAM
        stamped = header(204.0, "sonar")
        nothing = LaserScan(header=stamped), PointCloud(header=stamped)
        bad = [(String, String("rays")), (LaserScan, nothing[0]), (PointCloud, nothing[1]), (PointCloud2, cut),
               (PointCloud, nan), (LaserScan, away)]  # fmt: skip
        for number, (kind, message) in enumerate(bad, 1):
            rays = publisher("/sonar/rays", kind)
            rays.publish(message)
            self.diagnostics.wait_for("gazebo_sonar", "scans refused", number)
            end_publishing(rays)
        self._beam_of(publisher("/sonar/rays", LaserScan), scan)


if __name__ == "__main__":
    run(GazeboSonar)
