"""What the tests of the drivers' nodes share: their beams and diagnostics."""

from typing import Dict

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from graph import Inbox

from underwater_map_construction.msg import SonarScanLine


def beams() -> Inbox:
    """Return an inbox of the driver's beams."""
    return Inbox("sonar/raw", SonarScanLine)


def diagnostics(name: str = "imagenex_852_driver") -> Inbox:
    """Return an inbox of the diagnostics of one node."""

    def is_of_node(array: DiagnosticArray) -> bool:
        return any(status.name.endswith(f": {name}") and status.values for status in array.status)

    return Inbox("/diagnostics", DiagnosticArray, is_of_node)


def values(array: DiagnosticArray) -> Dict[str, str]:
    """Return the keys and values of an array's first status."""
    return {pair.key: pair.value for pair in array.status[0].values}


def level(array: DiagnosticArray) -> int:
    """Return the level of an array's first status, as an integer in every version of the message."""
    value = array.status[0].level
    return value[0] if isinstance(value, bytes) else value


ERROR = DiagnosticStatus.ERROR[0] if isinstance(DiagnosticStatus.ERROR, bytes) else DiagnosticStatus.ERROR
