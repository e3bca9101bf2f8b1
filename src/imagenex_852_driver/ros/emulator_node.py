"""The ROS side of the emulated head: parameters and requests for faults in; a serial port out."""

import os
from contextlib import ExitStack
from typing import Callable, Optional

import rospkg
import rospy

from imagenex_852_driver.emulator import EchoSource, EmulatedHead, Fault, FaultInjector, FixedPattern, PtyServer
from imagenex_852_driver.emulator.parameters import EchoSourceKind, EmulatorParameters
from node_support.ros.node import DIAGNOSTICS_PERIOD, StartError, every, make_health
from node_support.ros.reconfigurable_parameters import ReconfigurableParameters
from underwater_map_construction.srv import OrderFault, OrderFaultRequest, OrderFaultResponse

PACKAGE = "underwater_map_construction"
_MOST_ORDERED = 100000  # Hours of pings; more is a slip of the keyboard

# Builds the simulator's echoes; passed in, because the driver must not depend on the simulator.
WorldEchoes = Callable[[EmulatorParameters], EchoSource]


class EmulatorNode:
    """Serves an emulated head until shutdown."""

    def __init__(self, world_echoes: WorldEchoes) -> None:
        """Raises ParameterError for a bad parameter, and StartError when the world or the port cannot be made."""
        self.health = make_health("imagenex_852_emulator")
        self.healths = [self.health]
        self._faults: Optional[FaultInjector] = None
        self._live = ReconfigurableParameters(
            EmulatorParameters, "~", "Imagenex852Emulator", self.health, self._use_parameters
        )
        parameters = self._live.current
        source = _echo_source(parameters, world_echoes)
        head = EmulatedHead(source, self._faults, parameters.timing(), parameters.head_id)
        link = os.path.expanduser(parameters.link)
        self._line = ExitStack()
        try:
            self._line.enter_context(PtyServer(head, link))
        except OSError as error:
            raise StartError(f"link = {link!r}: the port cannot be made: {error}") from error
        rospy.on_shutdown(self._line.close)
        rospy.Service("~order_fault", OrderFault, self._order)
        every(DIAGNOSTICS_PERIOD, self._show_counts, self.health)
        rospy.loginfo("%s: the head is at %s", self.health.name, link)

    def _use_parameters(self, parameters: EmulatorParameters) -> None:
        if self._faults is None:
            self._faults = FaultInjector(parameters, parameters.seed)
        self._faults.rates = parameters

    def _show_counts(self) -> None:
        for fault, count in dict(self._faults.counts).items():
            self.health.total("good replies" if fault is Fault.NONE else fault.value, count)

    def _order(self, request: OrderFaultRequest) -> OrderFaultResponse:
        try:
            fault = Fault(request.fault)
        except ValueError:
            return OrderFaultResponse(False, f"{request.fault!r}: must be one of {', '.join(f.value for f in Fault)}")
        if not 1 <= request.count <= _MOST_ORDERED:
            return OrderFaultResponse(False, f"count = {request.count}: must be from 1 to {_MOST_ORDERED}")
        self._faults.order(fault, request.count)
        return OrderFaultResponse(True, f"{fault.value} {request.count} times")


def _echo_source(parameters: EmulatorParameters, world_echoes: WorldEchoes) -> EchoSource:
    if parameters.echo_source is EchoSourceKind.PATTERN:
        return FixedPattern(parameters.wall_distance)
    world_file = os.path.join(rospkg.RosPack().get_path(PACKAGE), os.path.expanduser(parameters.world_file))
    return world_echoes(parameters.changed({"world_file": world_file}))
