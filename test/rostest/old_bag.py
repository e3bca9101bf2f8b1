"""Bags as the 2015 package recorded them: its messages differ from ours in the name of their package only."""

from pathlib import Path
from typing import Any, Dict

import genpy.dynamic
import rosbag
from foreign_messages import serialised

NEW_PACKAGE, OLD_PACKAGE = "underwater_map_construction", "avora_msgs"


def old_type(new_type: Any) -> Any:
    """Return the class that the 2015 package had for a message class of today."""
    name = new_type._type.replace(NEW_PACKAGE, OLD_PACKAGE)
    return genpy.dynamic.generate_dynamic(name, new_type._full_text)[name]


def with_old_types(source: Path, target: Path, beams: str = "/sonar/raw") -> None:
    """Copy a bag, with every message of this package under its old type, and its beams on the topic `beams`."""
    old_types: Dict[str, Any] = {}
    with rosbag.Bag(str(source)) as recorded, rosbag.Bag(str(target), "w") as written:
        for topic, message, time in recorded.read_messages():
            name = message._type
            if name.startswith(f"{NEW_PACKAGE}/"):
                if name not in old_types:
                    old_types[name] = old_type(type(message))
                message = old_types[name]().deserialize(serialised(message))
            written.write(beams if topic == "/sonar/raw" else topic, message, time)
