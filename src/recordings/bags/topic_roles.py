"""What a topic is good for, by its type and name."""

from enum import Enum
from typing import Dict, List, Optional

from dead_reckoning.velocity_messages import VELOCITY_TYPES
from recordings.bags.bag import Topic
from sonar_processing.beams.beam_types import BEAM_TYPES, IMAGE, UNLIKELY

ODOMETRY = "nav_msgs/Odometry"


class Role(Enum):
    """What can be made of the messages of a topic."""

    BEAMS = "beams"
    ODOMETRY = "odometry"
    HEADING = "heading"
    DEPTH = "depth"
    VELOCITY = "velocity"
    POSITION = "true position"
    TRANSFORMS = "transforms"


# The best of a role first.
_TYPES: Dict[Role, List[str]] = {
    Role.BEAMS: [*(name for name in BEAM_TYPES if name not in UNLIKELY), *UNLIKELY],
    Role.ODOMETRY: [
        ODOMETRY, "geometry_msgs/PoseWithCovarianceStamped", "geometry_msgs/PoseStamped",
    ],
    Role.HEADING: ["sensor_msgs/Imu"],
    Role.DEPTH: ["sensor_msgs/FluidPressure"],
    Role.VELOCITY: [name for name in VELOCITY_TYPES if name != ODOMETRY],
    Role.POSITION: ["sensor_msgs/NavSatFix"],
    Role.TRANSFORMS: ["tf2_msgs/TFMessage", "tf/tfMessage"],
}  # fmt: skip
_ROLES = {name: role for role, names in _TYPES.items() for name in names}
_NUMBERS = ("std_msgs/Float32", "std_msgs/Float64")
# Parts of names of poses that are wanted, or known by other means than the vehicle's own.
_NO_ODOMETRY = (
    "setpoint", "goal", "target", "command", "truth", "gps", "dgps", "gnss", "/gt", "waypoint", "home", "heading",
)  # fmt: skip
_COMMANDS = ("cmd", "command", "setpoint", "target", "desired")
_LIKELY = ("odom", "local_position", "dead_reckoning", "navigation", "pose")


def role_of(topic: Topic) -> Optional[Role]:
    """Return the role of a topic; None where it has none."""
    name = topic.name.lower()
    if topic.type in _NUMBERS:
        if "depth" in name:
            return Role.DEPTH
        return Role.HEADING if any(part in name for part in ("heading", "compass", "hdg", "yaw")) else None
    role = _ROLES.get(topic.type)
    if topic.type == IMAGE and ("msis" not in name or "display" in name):
        return None
    if role is Role.ODOMETRY and any(part in name for part in _NO_ODOMETRY):
        return Role.POSITION if any(part in name for part in ("truth", "gps", "gnss", "/gt")) else None
    if role is Role.VELOCITY and any(part in name for part in _COMMANDS):
        return None
    return role


def with_role(topics: Dict[str, Topic], role: Role) -> List[Topic]:
    """Return the topics of a role that hold messages, the likeliest first."""
    found = [topic for topic in topics.values() if topic.count and role_of(topic) is role]
    return sorted(found, key=lambda topic: (*_rank(topic, role), topic.name))


def _rank(topic: Topic, role: Role) -> List[int]:
    types, name = _TYPES[role], topic.name.lower()
    kind = types.index(topic.type) if topic.type in types else len(types)
    likely = next((index for index, part in enumerate(_LIKELY) if part in name), len(_LIKELY))
    return [kind, likely] if role is Role.ODOMETRY else [kind]
