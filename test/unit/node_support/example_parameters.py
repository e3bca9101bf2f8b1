"""A parameter set with a field of every type."""

from dataclasses import dataclass
from enum import Enum

from node_support.parameters import ParameterError, ParameterSet, parameter


class Color(Enum):
    """Two choices whose values differ from their names."""

    RED = "red"
    DEEP_BLUE = "deep+blue"


@dataclass(frozen=True)
class ExampleParameters(ParameterSet):
    """A field of every type, and two that must fit together."""

    radius: float = parameter(1.5, "how far", unit="m", low=0.0, high=10.0, thesis_name="minRadius")
    count: int = parameter(20, "how many", low=1, high=1000)
    fast: bool = parameter(False, "whether fast")
    frame: str = parameter("odom", "which frame", tunable=False)
    color: Color = parameter(Color.RED, "which color")
    step: float = parameter(0.1, "how fine", low=0.0, expert="a tenth is fine enough")
    inner: float = parameter(0.5, "not more than radius", unit="m", low=0.0)

    def check(self):
        """Refuse an inner radius that is not inside."""
        if self.inner > self.radius:
            raise ParameterError(f"inner = {self.inner}: must be at most radius = {self.radius}")
