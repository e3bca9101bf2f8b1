"""Small bags as other people record them: one turn of a sonar on a vehicle that goes ahead with 0.5 m/s."""

from contextlib import contextmanager

import numpy as np

from node_support.files import whole_file
from recordings.bags.writers import BagWriter

BEAMS = 200
START, END = 100.0, 110.0
SPEED = 0.5


def nanoseconds(seconds):
    return round(float(seconds) * 1e9)


@contextmanager
def written(path):
    with whole_file(path) as part, BagWriter(part) as bag:
        yield bag


def stamped(bag, kind, time, frame):
    message = bag.make(kind)
    message.header.stamp, message.header.frame_id = bag.time(nanoseconds(time)), frame
    return message


def add_beams(bag, topic="/scan", frame="head", start=START):
    for index, time in enumerate(np.linspace(start, start + END - START, BEAMS)):
        beam = stamped(bag, "underwater_map_construction/SonarScanLine", time, frame)
        beam.angle, beam.maxrange_meters, beam.range_resolution = 2.0 * np.pi * index / BEAMS, 10.0, 0.1
        beam.intensities = np.where(np.arange(100) == 50, 200, 0).astype(np.uint8)
        bag.write(topic, beam, nanoseconds(time))


def poses():
    """Yield times and places on the vehicle's way."""
    for time in np.linspace(START, END, 101):
        yield time, SPEED * (time - START)


@contextmanager
def of_beams(path, **options):
    """Yield a bag with the beams of a turn."""
    with written(path) as bag:
        add_beams(bag, **options)
        yield bag


def add_odometry(bag, topic="/nav/odometry", frame="world", child="hull", has_positions=True):
    for time, x in poses():
        message = stamped(bag, "nav_msgs/Odometry", time, frame)
        message.child_frame_id = child
        message.pose.pose.orientation.w = 1.0
        message.twist.twist.linear.x = SPEED
        if has_positions:
            message.pose.pose.position.x = x
        bag.write(topic, message, nanoseconds(time))


def add_poses(bag, topic):
    for time, x in poses():
        message = stamped(bag, "geometry_msgs/PoseStamped", time, "map")
        message.pose.position.x, message.pose.orientation.w = x, 1.0
        bag.write(topic, message, nanoseconds(time))


def add_imu(bag, topic="/imu/data", gravity=9.8):
    for time, _ in poses():
        message = stamped(bag, "sensor_msgs/Imu", time, "imu")
        message.orientation.w, message.linear_acceleration.z = 1.0, gravity
        bag.write(topic, message, nanoseconds(time))


def add_velocities(bag, topic="/dvl/twist", frame="base_link", y=0.0):
    for time, _ in poses():
        message = stamped(bag, "geometry_msgs/TwistWithCovarianceStamped", time, frame)
        message.twist.twist.linear.x, message.twist.twist.linear.y = SPEED, y
        bag.write(topic, message, nanoseconds(time))


def add_fixed(bag, parent, child, x=0.0, topic="/tf_static"):
    message = stamped(bag, "geometry_msgs/TransformStamped", START, parent)
    message.child_frame_id = child
    message.transform.translation.x, message.transform.rotation.w = x, 1.0
    transforms = bag.make("tf2_msgs/TFMessage")
    transforms.transforms = [message]
    bag.write(topic, transforms, nanoseconds(START))
