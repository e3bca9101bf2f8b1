#!/usr/bin/env python3
"""Ray scans of three types, from a sensor that sees the whole circle and from one that a joint turns, become beams."""

import math
import unittest

import numpy as np
import rospy
import tf2_ros
from geometry_msgs.msg import Point32
from graph import Diagnostics, Inbox, end_publishing, publisher, run, wait_for_listeners
from messages import transform
from sensor_msgs.msg import ChannelFloat32, JointState, LaserScan, PointCloud, PointCloud2
from std_msgs.msg import Header, String

from sonar_processing.ros.conversions import point_cloud
from underwater_map_construction.msg import SonarScanLine

FULL_CIRCLE, BEAM = 2.0 * math.pi, math.radians(2.5)
WALL = 12.0  # m ahead, across the sensor's x axis
MOST_SCANS = 1200  # ten turns
RANGE_MIN, RANGE_MAX = 0.1, 50.1
VERTICAL = np.radians(np.linspace(-11.0, 11.0, 9))


# Messages as Gazebo's ray sensor plugins lay them out.
def _ranges(bearings: np.ndarray) -> np.ndarray:
    """Return distances (rows, columns), m; beyond the greatest range where the wall is not."""
    with np.errstate(divide="ignore"):
        distances = WALL / (np.cos(VERTICAL)[:, np.newaxis] * np.cos(bearings))
    return np.where((distances > 0.0) & (distances < RANGE_MAX), distances, np.inf)


def laser_scan(header: Header, opening: float = FULL_CIRCLE, columns: int = 721) -> LaserScan:
    """As gazebo_ros_laser: all rows one after the other, inf where nothing is hit, no word of the rows."""
    bearings = np.linspace(-opening / 2, opening / 2, columns)
    ranges = _ranges(bearings).ravel().tolist()
    return LaserScan(
        header=header, angle_min=-opening / 2, angle_max=opening / 2, angle_increment=opening / (columns - 1),
        range_min=RANGE_MIN, range_max=RANGE_MAX, ranges=ranges, intensities=[0.0] * len(ranges),
    )  # fmt: skip


def _points(opening: float, columns: int) -> np.ndarray:
    """As gazebo_ros_block_laser: points at the greatest range less the smallest where nothing is hit, z upside down."""
    bearings = np.linspace(-opening / 2, opening / 2, columns)
    ranges = np.minimum(_ranges(bearings), RANGE_MAX - RANGE_MIN)
    level = ranges * np.cos(VERTICAL)[:, np.newaxis]
    down = -ranges * np.sin(VERTICAL)[:, np.newaxis]
    return np.stack([level * np.cos(bearings), level * np.sin(bearings), down], axis=-1).reshape(-1, 3)


def block_laser(header: Header, opening: float = FULL_CIRCLE, columns: int = 721) -> PointCloud:
    """As gazebo_ros_block_laser: one channel without a name."""
    points = [Point32(*point) for point in _points(opening, columns).tolist()]
    return PointCloud(header, points, [ChannelFloat32(values=[0.0] * len(points))])


def cloud2(header: Header) -> PointCloud2:
    """As plugins that publish PointCloud2: x, y, z and intensity."""
    points = _points(FULL_CIRCLE, 721)
    return point_cloud(np.column_stack([points, np.zeros(len(points))]), header.stamp.to_nsec(), header.frame_id)


def header(seconds: float, frame_id: str = "sonar") -> Header:
    """Return a header of some seconds after the Epoch."""
    return Header(stamp=rospy.Time.from_sec(seconds), frame_id=frame_id)


def _strongest(beam: SonarScanLine) -> float:
    """Return the range of a beam's middle of strength, m."""
    strengths = np.frombuffer(beam.intensities, dtype=np.uint8).astype(float)
    return float(np.average(np.arange(len(strengths)) + 0.5, weights=strengths**2)) * beam.range_resolution


class GazeboSonar(unittest.TestCase):
    """One node whose sensor sees all around, and one whose sensor turns."""

    @classmethod
    def setUpClass(cls) -> None:
        cls.diagnostics = Diagnostics()
        cls.swept = Inbox("/sonar/raw", SonarScanLine).linked()

    def _beam_of(self, rays: rospy.Publisher, message: object) -> SonarScanLine:
        rays.publish(message)
        return self.swept.wait_for(lambda beam: beam.header.stamp == message.header.stamp)

    def _sweep_until_the_joint_is_known(self) -> None:
        """Send scans until a beam straight ahead is tilted: the joint state may come after some scans."""
        rays = publisher("/sonar/rays", LaserScan)
        for number in range(MOST_SCANS):
            beam = self._beam_of(rays, laser_scan(header(1.0 + 0.01 * number)))
            if beam.sensorAngle != 0.0 and abs(beam.angle) < BEAM / 2:
                end_publishing(rays)
                return
        raise AssertionError(f"no joint state in {MOST_SCANS} scans")

    def test_a_full_circle_of_each_type_gives_one_beam_after_the_other(self) -> None:
        joints = publisher("/joint_states", JointState)
        joints.publish(JointState(name=["sonar_servo_joint"], position=[0.25]))
        self._sweep_until_the_joint_is_known()
        for number, (kind, make) in enumerate(
            ((LaserScan, laser_scan), (PointCloud, block_laser), (PointCloud2, cloud2)), 1
        ):
            rays = publisher("/sonar/rays", kind)
            beam = self._beam_of(rays, make(header(100.0 + number)))
            self.assertAlmostEqual(beam.angle, math.radians(3.0 * number), places=6)
            self.assertAlmostEqual(_strongest(beam), WALL / math.cos(beam.angle), delta=0.6)
            self.assertEqual((beam.header.frame_id, len(beam.intensities), beam.maxrange_meters), ("sonar", 500, 50.0))
            self.assertAlmostEqual(beam.sensorAngle, 0.25, places=6)
            end_publishing(rays)

    def test_a_sensor_on_a_joint_gives_beams_where_tf_says_it_looks(self) -> None:
        """Also when tf comes after the scan."""
        start, turned = float(round(rospy.get_time())), Inbox("/turning/sonar/raw", SonarScanLine).linked()
        rays, transforms = publisher("/turning/sonar/rays", PointCloud), tf2_ros.StaticTransformBroadcaster()
        # The scan waits a few seconds for its transform, and a new connection may take as long on a busy machine.
        wait_for_listeners(transforms.pub_tf)
        rays.publish(block_laser(header(start, "sonar_head"), BEAM, 5))
        transforms.sendTransform(transform("sonar", "sonar_head", yaw=-1.2))
        beam = turned.wait_for()
        self.assertAlmostEqual(beam.angle, -1.2, places=6)
        self.assertAlmostEqual(_strongest(beam), WALL, delta=0.5)
        self.assertEqual((beam.header.frame_id, beam.header.stamp.to_sec()), ("sonar", start))

    def test_scans_that_cannot_be_used_are_counted_and_the_node_goes_on(self) -> None:
        stamped, cut = header(200.0), cloud2(header(201.0))
        cut.data = cut.data[:-5]
        bad = String("rays"), LaserScan(header=stamped), PointCloud(header=stamped), cut
        for number, message in enumerate(bad, 1):
            rays = publisher("/sonar/rays", type(message))
            rays.publish(message)
            self.diagnostics.wait_for("gazebo_sonar", "scans refused", number)
            end_publishing(rays)
        self._beam_of(publisher("/sonar/rays", LaserScan), laser_scan(header(202.0)))


if __name__ == "__main__":
    run(GazeboSonar)
