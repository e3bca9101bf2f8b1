"""What messages of different instruments say of the vehicle's velocity over ground.

The functions take any object with the fields of the message, of rospy or of rosbags. Sources: the definitions of the
messages; for axes x ahead, y to the right, z down the DVL A50's manual (https://docs.waterlinked.com/dvl/axes/).
"""

from dataclasses import dataclass
from typing import Any, Callable, Dict, Optional, Tuple

import numpy as np

from node_support.errors import RefusedInput
from node_support.headers import stamp_ns

VELOCITIES_REFUSED = "velocities refused"
_DOWNWARD = np.array([1.0, -1.0, -1.0])
_INVALID = -1.0  # In the covariance of a velocity that could not be measured (cola2_msgs, uuv_sensor_ros_plugins_msgs)


@dataclass(frozen=True)
class VelocityFields:
    """One velocity as its message has it.

    stamp_ns: 0 where the message has none. frame_id: whose axes it is along; empty: the vehicle's or the instrument's.
    velocity: (3,) m/s.
    """

    stamp_ns: int
    frame_id: str
    velocity: np.ndarray


@dataclass(frozen=True)
class VelocityType:
    """One type of message.

    read: takes its fields. is_downward: its axes, unless tf tells them, are ahead, right, down instead of left and up.
    """

    read: Callable[[Any], VelocityFields]
    is_downward: bool = False

    def fields(self, message: Any) -> VelocityFields:
        """Return what a message says. Raises RefusedInput for one that says no velocity."""
        try:
            found = self.read(message)
        except (AttributeError, TypeError, ValueError) as error:
            raise RefusedInput(VELOCITIES_REFUSED, f"message not as expected: {error}") from error
        if not np.isfinite(found.velocity).all():
            raise RefusedInput(VELOCITIES_REFUSED, f"{found.velocity} m/s, must be finite")
        return found

    def in_vehicle(
        self, fields: VelocityFields, mount: Optional[np.ndarray], is_downward: bool = False
    ) -> Tuple[np.ndarray, np.ndarray]:
        """Return the (3,) velocity along the vehicle's axes, z up, and the place (2,) [m] on it that moves so.

        mount: T_base_instrument (4, 4); None for an instrument that is mounted straight at the origin.
        is_downward: the vehicle's own frames, in which some messages are, count z down.
        """
        if mount is not None:
            return mount[:3, :3] @ fields.velocity, mount[:2, 3]
        return fields.velocity * _DOWNWARD if self.is_downward or is_downward else fields.velocity, np.zeros(2)


def _twist(message: Any) -> VelocityFields:
    twist = getattr(message.twist, "twist", message.twist)
    return _fields(message, message.header.frame_id, twist.linear)


def _odometry(message: Any) -> VelocityFields:
    """Read the twist of an Odometry, which is along the axes of its child frame."""
    return _fields(message, message.child_frame_id, message.twist.twist.linear)


def _dvl(message: Any) -> VelocityFields:
    """Read a message of a DVL with `velocity` and, in some packages, whether it is valid."""
    covariance = getattr(message, "velocity_covariance", (0.0,))
    valid = getattr(message, "velocity_valid", getattr(message, "beam_velocities_valid", covariance[0] != _INVALID))
    _check(valid)
    return _fields(message, message.header.frame_id, message.velocity)


def _transducer_report(message: Any) -> VelocityFields:
    """Read a TransducerReportStamped of waterlinked_a50, which has no header, or one."""
    report = message.report
    _check(report.velocity_valid)
    stamp = stamp_ns(message.header) if hasattr(message, "header") else 0
    return VelocityFields(stamp, "", np.array([report.vx, report.vy, report.vz], dtype=np.float64))


def _check(valid: bool) -> None:
    if not valid:
        raise RefusedInput(VELOCITIES_REFUSED, "the DVL hears no bottom")


def _fields(message: Any, frame_id: str, velocity: Any) -> VelocityFields:
    vector = np.array([velocity.x, velocity.y, velocity.z], dtype=np.float64)
    return VelocityFields(stamp_ns(message.header), frame_id.lstrip("/"), vector)


_NAMES: Tuple[Tuple[Tuple[str, ...], VelocityType], ...] = (
    (("geometry_msgs/TwistWithCovarianceStamped", "geometry_msgs/TwistStamped"), VelocityType(_twist)),
    (
        (
            "waterlinked_a50_ros_driver/DVL", "waterlinked_a50/DVL", "dvl_msgs/DVL", "smarc_msgs/DVL", "cola2_msgs/DVL",
            "nortek_dvl/Dvl", "marine_acoustic_msgs/Dvl", "acoustic_msgs/Dvl",
        ),
        VelocityType(_dvl, is_downward=True),
    ),
    (("uuv_sensor_ros_plugins_msgs/DVL",), VelocityType(_dvl)),
    (("waterlinked_a50/TransducerReportStamped",), VelocityType(_transducer_report, is_downward=True)),
    (("nav_msgs/Odometry",), VelocityType(_odometry)),
)  # fmt: skip

VELOCITY_TYPES: Dict[str, VelocityType] = {name: kind for names, kind in _NAMES for name in names}
"""By the names of the types in ROS 1, those that serve best first."""


def velocity_type(name: str) -> VelocityType:
    """Return what is known of a type by its name in ROS 1; raises RefusedInput for a type that is not read."""
    if name not in VELOCITY_TYPES:
        known = ", ".join(VELOCITY_TYPES)
        raise RefusedInput("messages of unknown types", f"{name} is not read as a velocity; known are {known}")
    return VELOCITY_TYPES[name]
