"""Deserialises messages whose packages are not installed, by the definition that came with the connection."""

from typing import Dict, Tuple

import genpy
import genpy.dynamic
from rospy import AnyMsg
from sensor_msgs.msg import LaserScan

from node_support.errors import RefusedInput
from underwater_map_construction.msg import SonarScanLine

_BUILT: Tuple[type, ...] = (SonarScanLine, LaserScan)
_KIND = "messages not readable"


class MessageClasses:
    """Makes and keeps one class for each type and definition."""

    def __init__(self) -> None:
        self._classes: Dict[str, type] = {kind._md5sum: kind for kind in _BUILT}

    def deserialised(self, message: AnyMsg) -> genpy.Message:
        """Return the message; raises RefusedInput when definition and bytes do not make one."""
        header = message._connection_header
        made = self._class_of(header["type"], header["md5sum"], header.get("message_definition", ""))
        try:
            return made().deserialize(message._buff)
        except (genpy.DeserializationError, ValueError, MemoryError) as error:
            raise RefusedInput(_KIND, f"{header['type']}: {error}") from error

    def _class_of(self, name: str, md5sum: str, definition: str) -> type:
        if md5sum not in self._classes:
            try:
                self._classes[md5sum] = genpy.dynamic.generate_dynamic(name, definition)[name]
            except Exception as error:  # Whatever the parser, the generator or the generated code stumbles over
                raise RefusedInput(_KIND, f"{name}: no usable definition: {error}") from error
        return self._classes[md5sum]
