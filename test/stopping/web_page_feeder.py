"""A vehicle that goes ahead at .5 m/s in a basin, until it is killed: tf, beams, and echoes every two seconds."""

import numpy as np
import rospy
import tf2_ros
from geometry_msgs.msg import TransformStamped

from sonar_processing.cloud import Cloud
from sonar_processing.ros.conversions import cloud_to_message, header
from underwater_map_construction.msg import SonarScanLine, StampedIntensityCloud

RATE, SCAN = 10, 20  # steps a second, steps of a scan
SIDES = [((-12, 12), (60, 12)), ((60, 12), (60, -10)), ((60, -10), (-12, -10)), ((-12, -10), (-12, 12))]
WALLS = np.vstack([np.linspace(*ends, 80, endpoint=False) for ends in np.array(SIDES, dtype=float)])


def transform(stamp, parent, child, x):
    message = TransformStamped(header=header(stamp.to_nsec(), parent), child_frame_id=child)
    message.transform.translation.x, message.transform.translation.z = x, -2.0 if child == "base_link" else 0.0
    message.transform.rotation.w = 1.0
    return message


def beam(stamp, step):
    strengths = np.zeros(500, dtype=np.uint8)
    strengths[240:250] = 200
    return SonarScanLine(
        header=header(stamp.to_nsec(), "sonar"), angle=step * 0.0524 % (2.0 * np.pi), intensities=strengths.tobytes(),
        maxrange_meters=20.0, range_resolution=0.04,
    )  # fmt: skip


def scan(stamp):
    rows = np.column_stack([WALLS, np.full(len(WALLS), -2.0), np.full(len(WALLS), 50.0)]).astype(np.float32)
    times = np.linspace(stamp.to_sec() - SCAN / RATE, stamp.to_sec(), len(WALLS))
    return cloud_to_message(Cloud(rows, -times, stamp.to_nsec(), "odom"))


def main():
    rospy.init_node("feeder")
    beams = rospy.Publisher("/sonar/raw", SonarScanLine, queue_size=10)
    echoes = rospy.Publisher("/sonar/scan/echoes", StampedIntensityCloud, queue_size=2)
    moving, fixed = tf2_ros.TransformBroadcaster(), tf2_ros.StaticTransformBroadcaster()
    fixed.sendTransform(transform(rospy.Time.now(), "base_link", "sonar", 0.3))
    rate, step = rospy.Rate(RATE), 0
    while not rospy.is_shutdown():
        stamp = rospy.Time.now()
        moving.sendTransform(transform(stamp, "odom", "base_link", 0.5 * step / RATE))
        beams.publish(beam(stamp, step))
        if step and step % SCAN == 0:
            echoes.publish(scan(stamp))
        step += 1
        rate.sleep()


if __name__ == "__main__":
    main()
