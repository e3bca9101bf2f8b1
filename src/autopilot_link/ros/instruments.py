"""Publishes what an autopilot measures, as dead_reckoning takes it."""

from typing import Any, Optional

import numpy as np
import rospy
from geometry_msgs.msg import Quaternion, TwistStamped, Vector3
from sensor_msgs.msg import FluidPressure, Imu
from std_msgs.msg import Header

from autopilot_link.protocol import rotation_of_attitude, velocity_of_ned
from node_support import topics
from node_support.errors import RefusedInput
from node_support.geometry import quaternion_of
from node_support.headers import check_stamp

_PASCAL = 100.0  # in a hectopascal


class Instruments:
    """Heading from ATTITUDE, pressure from SCALED_PRESSURE2, velocity from LOCAL_POSITION_NED."""

    def __init__(self, base_frame: str) -> None:
        self._base_frame = base_frame
        self._orientation: Optional[np.ndarray] = None
        self._headings = rospy.Publisher(topics.HEADING, Imu, queue_size=10, tcp_nodelay=True)
        self._depths = rospy.Publisher(topics.DEPTH, FluidPressure, queue_size=10)
        self._velocities = rospy.Publisher(topics.MEASURED_VELOCITY, TwistStamped, queue_size=10)

    def take(self, message: Any, offset_ns: Optional[int]) -> None:
        """Take a message of the autopilot, whose clock is `offset_ns` ahead of ours, None where nobody knows.

        Raises RefusedInput for one that is broken.
        """
        takers = {
            "ATTITUDE": self._take_attitude,
            "SCALED_PRESSURE2": self._take_pressure,
            "LOCAL_POSITION_NED": self._take_velocity,
        }
        take = takers.get(message.get_type())
        if take is not None:
            take(message, self._header(message.time_boot_ms, offset_ns))

    def _header(self, boot_ms: int, offset_ns: Optional[int]) -> Header:
        stamp_ns = rospy.get_rostime().to_nsec() if offset_ns is None else boot_ms * 10**6 - offset_ns
        check_stamp(stamp_ns)
        return Header(stamp=rospy.Time(*divmod(stamp_ns, 10**9)), frame_id=self._base_frame)

    def _take_attitude(self, attitude: Any, header: Header) -> None:
        self._orientation = rotation_of_attitude(attitude.roll, attitude.pitch, attitude.yaw)
        imu = Imu(header=header, orientation=Quaternion(*quaternion_of(self._orientation)))
        # Rates are the vehicle's own, ahead, right, down.
        imu.angular_velocity = Vector3(attitude.rollspeed, -attitude.pitchspeed, -attitude.yawspeed)
        imu.linear_acceleration_covariance[0] = -1.0  # not measured (sensor_msgs/Imu)
        self._headings.publish(imu)

    def _take_pressure(self, pressure: Any, header: Header) -> None:
        self._depths.publish(FluidPressure(header=header, fluid_pressure=pressure.press_abs * _PASCAL))

    def _take_velocity(self, local: Any, header: Header) -> None:
        if self._orientation is None:
            raise RefusedInput("velocities refused", "LOCAL_POSITION_NED came before any ATTITUDE")
        twist = TwistStamped(header=header)
        velocity = velocity_of_ned((local.vx, local.vy, local.vz), self._orientation)
        twist.twist.linear = Vector3(*velocity)
        self._velocities.publish(twist)
