"""Definitions of message types: our own, and those of bags that do not hold any."""

from functools import lru_cache

from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

BEAM_TYPE = "underwater_map_construction/msg/SonarScanLine"

# msg/SonarScanLine.msg; an installation without ROS does not have that file.
_BEAM_DEFINITION = """\
Header header
float32 angle
uint8[] intensities
float32 maxrange_meters
float32 range_resolution
uint8 gain
float32 sensorAngle
"""
_OWN_TYPES = {
    BEAM_TYPE: _BEAM_DEFINITION,
    "avora_msgs/msg/SonarScanLine": _BEAM_DEFINITION,
    "tf2_msgs/msg/TFMessage": "geometry_msgs/TransformStamped[] transforms\n",
}


def defined_in(definition: str, name: str) -> Typestore:
    """Return a store with the type `name` and those it consists of, as a bag defines them."""
    store = get_typestore(Stores.EMPTY)
    store.register(get_types_from_msg(definition, name))
    return store


@lru_cache(maxsize=None)
def ros1_types() -> Typestore:
    """Return the types of ROS 1 (Noetic) and ours."""
    return _with_ours(Stores.ROS1_NOETIC)


@lru_cache(maxsize=None)
def ros2_types() -> Typestore:
    """Return the types of ROS 2 and ours, for bags of distributions before Iron, which hold no definitions."""
    return _with_ours(Stores.ROS2_HUMBLE)


def _with_ours(distribution: Stores) -> Typestore:
    store = get_typestore(distribution)
    for name, definition in _OWN_TYPES.items():
        if name not in store.types:
            store.register(get_types_from_msg(definition, name))
    return store
