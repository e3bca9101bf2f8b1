"""A vehicle that goes ahead at .5 m/s in a basin, until it is killed: tf, beams, and echoes every two seconds."""

import sys
from pathlib import Path

import numpy as np
import rospy
import tf2_ros

sys.path.append(str(Path(__file__).resolve().parents[1] / "rostest"))

from messages import beam, still_echoes, transform

from underwater_map_construction.msg import SonarScanLine, StampedIntensityCloud

RATE, SCAN = 10, 20  # steps a second, steps of a scan
SIDES = [((-12, 12), (60, 12)), ((60, 12), (60, -10)), ((60, -10), (-12, -10)), ((-12, -10), (-12, 12))]
WALLS = np.vstack([np.linspace(*ends, 80, endpoint=False) for ends in np.array(SIDES, dtype=float)])


def vehicle(now, x):
    message = transform("odom", "base_link", now, x)
    message.transform.translation.z = -2.0
    return message


def main():
    rospy.init_node("feeder")
    beams = rospy.Publisher("/sonar/raw", SonarScanLine, queue_size=10)
    echoes = rospy.Publisher("/sonar/scan/echoes", StampedIntensityCloud, queue_size=2)
    moving, fixed = tf2_ros.TransformBroadcaster(), tf2_ros.StaticTransformBroadcaster()
    fixed.sendTransform(transform("base_link", "sonar", rospy.get_time(), 0.3))
    rate, step = rospy.Rate(RATE), 0
    while not rospy.is_shutdown():
        now = rospy.get_time()
        moving.sendTransform(vehicle(now, 0.5 * step / RATE))
        beams.publish(beam(now, step * 0.0524 % (2.0 * np.pi)))
        if step and step % SCAN == 0:
            echoes.publish(still_echoes(WALLS, np.linspace(now - SCAN / RATE, now, len(WALLS))))
        step += 1
        rate.sleep()


if __name__ == "__main__":
    main()
