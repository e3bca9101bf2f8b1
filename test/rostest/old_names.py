#!/usr/bin/env python3
"""Programs of 2015 find their topics and their service, and nothing that they send ends the node."""

import math
import unittest
from typing import Any

import genpy.dynamic
import rospy
from geometry_msgs.msg import Point
from graph import Diagnostics, Inbox, publisher, run
from sensor_msgs.msg import JointState, PointCloud2
from std_msgs.msg import Float64, Header

from underwater_map_construction.msg import ModelCoefficients, Wall, Walls
from underwater_map_construction.srv import SetScanMode, SetScanModeResponse

SERVO = "/charle/sonar_to_base_link_position_controller"
STATE = "control_msgs/JointControllerState"
# As ROS Indigo had it; Noetic has one more field at the end.
INDIGO = "Header header\nfloat64 set_point\nfloat64 process_value\n"
NOETIC = INDIGO + "bool antiwindup\n"
HEADER = f"{'=' * 80}\nMSG: std_msgs/Header\nuint32 seq\ntime stamp\nstring frame_id\n"


class ThesisTopics(unittest.TestCase):
    """Sends what the nodes of today send, and listens where programs of 2015 do."""

    def check_passed_on(self, topic: str, old: str, message: Any) -> None:
        inbox = Inbox(old, type(message)).linked()
        publisher(topic, type(message)).publish(message)
        inbox.wait_for(lambda found: found == message)

    def test_the_matched_scan_is_the_debug_cloud(self) -> None:
        self.check_passed_on("/MLSM/scan", "/debug_cloud", PointCloud2(header=Header(frame_id="map"), width=3))

    def test_points_of_walls_have_their_old_name(self) -> None:
        self.check_passed_on("/sonar/scan/line", "/sonar/walls/cloud", PointCloud2(header=Header(frame_id="odom")))

    def test_the_servo_gets_its_commands(self) -> None:
        self.check_passed_on("/sonar_servo/command", f"{SERVO}/command", Float64(data=0.5))

    def test_each_wall_comes_alone_and_as_pcl_has_it(self) -> None:
        walls = Inbox("/sonar/walls/coeff", Wall).linked()
        models = Inbox("/sonar/walls/model", ModelCoefficients).linked()
        ahead = Wall(distance=8.0, orientation=math.pi / 2.0, start=Point(-3.0, 8.0, -2.0), end=Point(1.0, 8.0, -2.0))
        dot = Wall(start=Point(5.0, 0.0, 0.0), end=Point(5.0, 0.0, 0.0))
        publisher("/sonar/scan/line/coefficients", Walls).publish(Walls(Header(frame_id="odom"), [ahead, dot]))
        self.assertEqual(walls.wait_for_number(2)[:2], [ahead, dot])
        found = models.wait_for_number(2)
        self.assertEqual(found[0].values, (-3.0, 8.0, -2.0, 1.0, 0.0, 0.0))
        self.assertEqual(found[0].header.frame_id, "odom")
        self.assertEqual(found[1].values, (5.0, 0.0, 0.0, 0.0, 0.0, 0.0))

    def test_the_message_is_pcls_own(self) -> None:
        """Programs that were built with pcl_msgs connect."""
        self.assertEqual(ModelCoefficients._md5sum, "ca27dea75e72cb894cd36f9e5005e93e")

    def test_states_of_the_servo_become_joint_states(self) -> None:
        joints, diagnostics = Inbox("/joint_states", JointState).linked(), Diagnostics()
        for number, definition in enumerate((INDIGO, NOETIC), start=1):
            kind = genpy.dynamic.generate_dynamic(STATE, definition + HEADER)[STATE]
            states = publisher(f"{SERVO}/state", kind)
            states.publish(kind(process_value=math.nan))
            states.publish(kind(header=Header(frame_id="servo"), process_value=0.25 * number))
            found = joints.wait_for(lambda joint, angle=0.25 * number: joint.position == (angle,))
            self.assertEqual(found.name, ["sonar_servo_joint"])
            states.unregister()
        diagnostics.wait_for("thesis_topics", "states of the servo refused", 2)

    def test_the_service_asks_sonar_control_and_says_when_it_is_missing(self) -> None:
        rospy.wait_for_service("sonar_control")
        call = rospy.ServiceProxy("sonar_control", SetScanMode)
        self.assertIn("does not answer", call("HORIZONTAL").message)
        asked = rospy.Service("sonar_control/set_mode", SetScanMode, lambda one: SetScanModeResponse(True, one.mode))
        self.assertEqual(call("HORIZONTAL"), SetScanModeResponse(True, "HORIZONTAL"))
        asked.shutdown()


if __name__ == "__main__":
    run(ThesisTopics)
