"""The ROS side of every emulated head: parameters and requests for faults in; a line to a sonar out."""

import os
from contextlib import ExitStack
from dataclasses import dataclass
from typing import Any, Callable, Optional, Type

import numpy as np
import rospkg
import rospy

from node_support.health import Health
from node_support.ros.callbacks import every, make_health
from node_support.ros.node import DIAGNOSTICS_PERIOD, StartError
from node_support.ros.reconfigurable_parameters import ReconfigurableParameters
from node_support.ros.transforms import TfBuffer
from sonar_driver.emulator.emulated_head import EchoSource, EmulatedHead, FixedPattern
from sonar_driver.emulator.faults import EchoSourceKind, EmulatedHeadParameters, Fault, FaultInjector
from sonar_driver.emulator.head_server import HeadServer, ServedLine
from underwater_map_construction.srv import OrderFault, OrderFaultRequest, OrderFaultResponse

WORLD_FRAME = "world"
"""Frame of the world file that the emulated head hears."""

Place = Callable[[], Optional[np.ndarray]]
"""Returns the (4, 4) T_world_head of now; None where it is not known."""
PACKAGE = "underwater_map_construction"
_MOST_ORDERED = 100000  # Hours of pings; more is a slip of the keyboard
# Builds the simulator's echoes; passed in, because no driver may depend on the simulator.
WorldEchoes = Callable[[EmulatedHeadParameters, Optional[Place]], EchoSource]


def place_in_tf(frame: str, health: Health) -> Place:
    """Return what looks up the newest place of `frame` in the world; pings before tf knows it are counted."""
    transforms = TfBuffer(health)

    def place() -> Optional[np.ndarray]:
        found = transforms.newest(WORLD_FRAME, frame)
        if found is None:
            health.problem(
                "pings without a place",
                f"tf does not know {frame!r} in {WORLD_FRAME!r}; check head_frame and who publishes it",
            )
            return None
        return found[1]

    return place


@dataclass(frozen=True)
class HeadModel:
    """What the node needs to know of one kind of emulated head.

    name: the node's. head: makes the head. line: makes the line that it is served on,
    not yet open.
    """

    name: str
    parameters: Type[EmulatedHeadParameters]
    head: Callable[[Any, EchoSource, FaultInjector], EmulatedHead]
    line: Callable[[Any], ServedLine]


class EmulatorNode:
    """Serves an emulated head until shutdown."""

    def __init__(self, model: HeadModel, world_echoes: WorldEchoes) -> None:
        """Raises ParameterError for a bad parameter, and StartError when the world or the line cannot be made."""
        self.health = make_health(model.name)
        self.healths = [self.health]
        self._faults: Optional[FaultInjector] = None
        self._live = ReconfigurableParameters(model.parameters, "~", self.health, self._use_parameters)
        parameters = self._live.current.changed({"link": os.path.expanduser(self._live.current.link)})
        head = model.head(parameters, self._echo_source(parameters, world_echoes), self._faults)
        self._served = ExitStack()
        try:
            self._served.enter_context(HeadServer(head, model.line(parameters)))
        except OSError as error:
            raise StartError(f"link = {parameters.link!r}: the port cannot be made: {error}") from error
        rospy.on_shutdown(self._served.close)
        rospy.Service("~order_fault", OrderFault, self._order)
        every(DIAGNOSTICS_PERIOD, self._show_counts, self.health)
        rospy.loginfo("%s: the head is at %s", self.health.name, parameters.link)

    def _echo_source(self, parameters: EmulatedHeadParameters, world_echoes: WorldEchoes) -> EchoSource:
        if parameters.echo_source is EchoSourceKind.PATTERN:
            return FixedPattern(parameters.wall_distance)
        world_file = os.path.join(rospkg.RosPack().get_path(PACKAGE), os.path.expanduser(parameters.world_file))
        place = place_in_tf(parameters.head_frame, self.health) if parameters.head_frame else None
        return world_echoes(parameters.changed({"world_file": world_file}), place)

    def _use_parameters(self, parameters: EmulatedHeadParameters) -> None:
        if self._faults is None:
            self._faults = FaultInjector(parameters, parameters.seed)
        self._faults.rates = parameters

    def _show_counts(self) -> None:
        for fault, count in dict(self._faults.counts).items():
            self.health.total("good replies" if fault is Fault.NONE else fault.value, count)

    def _order(self, request: OrderFaultRequest) -> OrderFaultResponse:
        known = (Fault.NONE, *self._faults.rates.known())
        fault = next((fault for fault in known if fault.value == request.fault), None)
        if fault is None:
            return OrderFaultResponse(False, f"{request.fault!r}: must be one of {', '.join(f.value for f in known)}")
        if not 1 <= request.count <= _MOST_ORDERED:
            return OrderFaultResponse(False, f"count = {request.count}: must be from 1 to {_MOST_ORDERED}")
        self._faults.order(fault, request.count)
        return OrderFaultResponse(True, f"{fault.value} {request.count} times")
