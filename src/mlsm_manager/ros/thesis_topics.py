"""Topics and a service under their names of 2015, for programs that were written for them."""

import math
from typing import Any, Callable

import rospy
from sensor_msgs.msg import JointState, PointCloud2
from std_msgs.msg import Float64

from node_support import topics
from node_support.errors import RefusedInput
from node_support.ros.callbacks import MessageClasses, guarded, make_health
from underwater_map_construction.msg import ModelCoefficients, Wall, Walls
from underwater_map_construction.srv import SetScanMode, SetScanModeRequest, SetScanModeResponse

_QUEUE = 10
_STATE = "control_msgs/JointControllerState"


class ThesisTopics:
    """Passes on what the nodes of today publish, and what the servo's controller of 2015 says."""

    def __init__(self) -> None:
        self.health = make_health("thesis_topics")
        self._joint = rospy.get_param("sonar_control/joint", "sonar_servo_joint")
        self._classes = MessageClasses(())
        self._walls = rospy.Publisher("sonar/walls/coeff", Wall, queue_size=_QUEUE)
        self._models = rospy.Publisher("sonar/walls/model", ModelCoefficients, queue_size=_QUEUE)
        self._joints = rospy.Publisher(topics.JOINT_STATES, JointState, queue_size=_QUEUE)
        self._pass_on(topics.MATCHED_SCAN, "debug_cloud", PointCloud2)
        self._pass_on(topics.LINES, "sonar/walls/cloud", PointCloud2)
        self._pass_on(topics.SERVO_COMMANDS, f"{topics.SERVO_2015}/command", Float64)
        self._listen(f"{topics.LINES}/coefficients", Walls, self._take_walls)
        self._listen(f"{topics.SERVO_2015}/state", rospy.AnyMsg, self._take_state)
        self._set_mode = rospy.ServiceProxy("sonar_control/set_mode", SetScanMode)
        rospy.Service("sonar_control", SetScanMode, self._serve)

    def _pass_on(self, topic: str, old: str, kind: type) -> None:
        """Publish all messages of a topic under its old name too."""
        publisher = rospy.Publisher(old, kind, queue_size=_QUEUE, latch=kind is Float64)
        self._listen(topic, kind, publisher.publish)

    def _listen(self, topic: str, kind: type, take: Callable[[Any], None]) -> None:
        def counted(message: Any) -> None:
            self.health.count(f"messages of {topic}")
            take(message)

        rospy.Subscriber(topic, kind, guarded(self.health, counted), queue_size=_QUEUE)

    def _take_walls(self, message: Walls) -> None:
        for wall in message.walls:
            self._walls.publish(wall)
            self._models.publish(ModelCoefficients(message.header, line_model(wall)))

    def _take_state(self, message: rospy.AnyMsg) -> None:
        kind = message._connection_header["type"]
        if kind != _STATE:
            raise RefusedInput("states of the servo refused", f"{kind}, must be {_STATE}; check the servo's driver")
        state = self._classes.deserialised(message)
        if not math.isfinite(state.process_value):
            raise RefusedInput("states of the servo refused", f"process_value {state.process_value}, must be finite")
        self._joints.publish(JointState(header=state.header, name=[self._joint], position=[state.process_value]))

    def _serve(self, request: SetScanModeRequest) -> SetScanModeResponse:
        try:
            return self._set_mode(request.mode)
        except rospy.ServiceException as error:
            return SetScanModeResponse(False, f"sonar_control does not answer: {error}")


def line_model(wall: Wall) -> tuple:
    """Return x y z of a point on a wall and of its direction, as pcl::SampleConsensusModelLine has them."""
    start, end = wall.start, wall.end
    along = end.x - start.x, end.y - start.y, end.z - start.z
    length = math.sqrt(sum(one * one for one in along)) or 1.0
    return (start.x, start.y, start.z, *(one / length for one in along))
