"""The state at one moment of a simulation as messages, for publishers and for bags."""

from typing import Any, Callable, List, Tuple

import numpy as np

from node_support import topics
from recordings.bags.messages import Messages, Placing
from sonar_simulator.simulation.simulation import BASE_FRAME, SONAR_FRAME, Instruments, Moment, Ping

ODOM_FRAME = "odom"
MAP_FRAME = "map"
SERVO_JOINT = "sonar_servo_joint"

_VELOCITY = "geometry_msgs/Twist"
_ALWAYS = {
    topics.JOINT_STATES: "sensor_msgs/JointState",
    topics.GROUND_TRUTH: "nav_msgs/Odometry",
    topics.BEAMS: "underwater_map_construction/SonarScanLine",
}
TOPICS = {
    Instruments.DVL: {
        topics.TRANSFORMS: "tf2_msgs/TFMessage",
        topics.ODOMETRY: "nav_msgs/Odometry",
        topics.VELOCITY: _VELOCITY,
        **_ALWAYS,
    },
    Instruments.COMPASS: {
        topics.HEADING: "sensor_msgs/Imu",
        topics.DEPTH: "std_msgs/Float64",
        topics.VELOCITY: _VELOCITY,
        **_ALWAYS,
    },
    Instruments.NONE: {topics.TRANSFORMS: "tf2_msgs/TFMessage", **_ALWAYS},
}
"""Topics and their types; relative to the namespace, except /tf."""

_Told = List[Tuple[str, Any]]


def map_origin(T_world_start: np.ndarray, instruments: Instruments) -> np.ndarray:
    """Return where the frame map begins in the world, (3,) m, for a vehicle that starts at a (4, 4) pose.

    Without a DVL it knows no position: its dead reckoning, and so its map, begins at x = y = 0.
    """
    if instruments is Instruments.DVL:
        return np.zeros(3)
    return T_world_start[:3, 3] * [1.0, 1.0, 0.0]


class MomentMessages(Messages):
    """Fills in messages of any library, whose fields are named as in their definitions."""

    def __init__(self, make: Callable[[str], Any], octets: Callable[[np.ndarray], Any]) -> None:
        """`make` returns an empty message of a type, package/Name; `octets` what a field uint8[] takes."""
        super().__init__(make)
        self._octets = octets

    def at(self, moment: Moment, stamp: Any, max_range: float, instruments: Instruments, origin: np.ndarray) -> _Told:
        """Return (topic, message) pairs, the transform first; max_range [m] is the sonar's, origin (3,) m the map's.

        Transform and joint are part of every moment, so that a beam can be placed at its own stamp; the rest is part of
        ticks only, at the steady rate of an instrument.
        """
        messages = self.placing(moment, stamp, instruments)
        if moment.is_tick:
            messages += self._measured(moment, stamp, instruments, origin)
        if moment.ping is not None:
            messages.append((topics.BEAMS, self.scan_line(moment.ping, moment.tilt, stamp, SONAR_FRAME, max_range)))
        return messages

    def placing(self, moment: Moment, stamp: Any, instruments: Instruments) -> _Told:
        """Return the (topic, message) pairs that place vehicle and sonar, the transform, if there is one, first."""
        pose = moment.odometry.T_odom_base
        state = self.stamped("sensor_msgs/JointState", stamp, "")
        state.name, state.position = [SERVO_JOINT], np.array([moment.tilt])
        joint = (topics.JOINT_STATES, state)
        if instruments is not Instruments.COMPASS:
            transform = self.transform(Placing.of(pose), stamp, ODOM_FRAME, BASE_FRAME)
            return [(topics.TRANSFORMS, self.transforms([transform])), joint]
        if not moment.is_tick:
            return [joint]
        heading, depth = self.stamped("sensor_msgs/Imu", stamp, BASE_FRAME), self.make("std_msgs/Float64")
        turn = heading.orientation
        turn.x, turn.y, turn.z, turn.w = Placing.of(pose).turn
        depth.data = -pose[2, 3]
        return [(topics.HEADING, heading), (topics.DEPTH, depth), joint]

    def scan_line(self, ping: Ping, tilt: float, stamp: Any, frame: str, max_range: float) -> Any:
        """Return a beam's message; `tilt` [rad] is that of the sonar's servo, `max_range` [m] the last bin's end."""
        message = self.stamped(_ALWAYS[topics.BEAMS], stamp, frame)
        message.angle = ping.angle
        message.intensities = self._octets(ping.strengths)
        message.maxrange_meters = max_range
        message.range_resolution = max_range / len(ping.strengths)
        message.sensorAngle = tilt
        return message

    def _measured(self, moment: Moment, stamp: Any, instruments: Instruments, origin: np.ndarray) -> _Told:
        T_map_base = moment.truth.T_world_base.copy()
        T_map_base[:3, 3] -= origin
        truth = self._odometry(T_map_base, moment.truth.twist, stamp, MAP_FRAME)
        messages = [(topics.GROUND_TRUTH, truth)]
        if instruments is Instruments.DVL:
            odometry = self._odometry(moment.odometry.T_odom_base, moment.odometry.twist, stamp, ODOM_FRAME)
            messages.append((topics.ODOMETRY, odometry))
        if instruments is Instruments.NONE:
            return messages
        velocity = self.make(_VELOCITY)
        _move(velocity, moment.odometry.twist)
        return [(topics.VELOCITY, velocity), *messages]

    def _odometry(self, pose: np.ndarray, twist: np.ndarray, stamp: Any, frame: str) -> Any:
        message = self.odometry(Placing.of(pose), stamp, frame, BASE_FRAME)
        _move(message.twist.twist, twist)
        return message


def _move(twist: Any, values: np.ndarray) -> None:
    twist.linear.x, twist.linear.y, twist.linear.z = values[:3].tolist()
    twist.angular.x, twist.angular.y, twist.angular.z = values[3:].tolist()
