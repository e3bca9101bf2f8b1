"""Messages of any type, also of packages that are not installed, as objects."""

import shutil
import sys
from functools import partial
from pathlib import Path
from typing import Dict, Iterable

import genpy
import genpy.dynamic
import rospy

from node_support.errors import RefusedInput

_KIND = "messages not readable"


class MessageClasses:
    """Makes and keeps one class for each type and definition."""

    def __init__(self, built: Iterable[type] = ()) -> None:
        """`built`: classes that are there already and need not be made."""
        self._classes: Dict[str, type] = {kind._md5sum: kind for kind in built}

    def deserialised(self, message: rospy.AnyMsg) -> genpy.Message:
        """Return the message; raises RefusedInput when definition and bytes do not make one."""
        header = message._connection_header
        made = self._class_of(header["type"], header["md5sum"], header.get("message_definition", ""))
        try:
            return made().deserialize(message._buff)
        except (genpy.DeserializationError, ValueError, MemoryError) as error:
            raise RefusedInput(_KIND, f"{header['type']}: {error}") from error

    def _class_of(self, name: str, md5sum: str, definition: str) -> type:
        if md5sum not in self._classes:
            self._classes[md5sum] = _generated(name, definition)
        return self._classes[md5sum]


def _generated(name: str, definition: str) -> type:
    try:
        made = genpy.dynamic.generate_dynamic(name, definition)[name]
    except Exception as error:  # Whatever the parser, the generator or the generated code stumbles over
        raise RefusedInput(_KIND, f"{name}: no usable definition: {error}") from error
    # genpy imports the class from a folder of its own, which it removes at an exit that our nodes do not take.
    folder = Path(sys.modules[made.__module__].__file__).parent
    rospy.on_shutdown(partial(shutil.rmtree, folder, ignore_errors=True))
    return made
