"""The ROS side of every driver (thesis 4.5.1) and of every emulated head."""

import os
import threading
from contextlib import ExitStack
from functools import partial
from typing import Any, Callable, Optional, Type

import numpy as np
import rospy

from node_support import topics
from node_support.files import package_folder
from node_support.headers import check_stamp
from node_support.parameters import ParameterSet
from node_support.ros.callbacks import every, guarded, make_health
from node_support.ros.node import DIAGNOSTICS_PERIOD, StartError
from node_support.ros.reconfigurable_parameters import ReconfigurableParameters
from node_support.ros.transforms import JointAngle, TfBuffer
from sonar_driver.device import DriverHealth, LineDevice, LineStats
from sonar_driver.emulated_head import (
    EchoSource,
    EchoSourceKind,
    EmulatedHead,
    EmulatedHeadParameters,
    Fault,
    FaultInjector,
)
from sonar_driver.head_server import HeadServer, ServedLine
from sonar_driver.port import PortRefusedError, PortUnavailableError
from underwater_map_construction.msg import SonarScanLine
from underwater_map_construction.srv import OrderFault, OrderFaultRequest, OrderFaultResponse

_LONGEST_STOP = 1.0  # s: a ping at the longest range ends within this time
_PAUSE_AFTER_FAILURE = 1.0  # s: a failure that lasts must not fill the log


class DriverNode:
    """Keeps the head pinging, and publishes every valid reply once, in order."""

    def __init__(
        self,
        name: str,
        parameters: Type[ParameterSet],
        device: Type[LineDevice],
        message: Callable[[Any, Any], Optional[SonarScanLine]],
    ) -> None:
        """Raises ParameterError for a bad parameter and StartError for an unusable port.

        parameters: those of line, mounting and head, with a `command`; `LineParameters` and `MountingParameters` are
        among their bases. device: takes parameters, a stop event and a clock. message: makes the message of a ping, but
        for its header and the angle of the servo; None if it holds no echoes.
        """
        self._make_device = device
        self._message = message
        self._device: Optional[LineDevice] = None
        self._stop = threading.Event()
        self._last_stats = LineStats()
        self.health = DriverHealth(name, lambda line: rospy.logwarn("%s", line), self._stats)
        self._live = ReconfigurableParameters(parameters, "~", self.health, self._use_parameters)
        self._beams = rospy.Publisher(topics.BEAMS, SonarScanLine, queue_size=200, tcp_nodelay=True)
        self._tilt = JointAngle(self._live.current.sensor_joint, self.health)
        try:
            self._device.open()
        except PortRefusedError as error:
            raise StartError(str(error)) from error
        except PortUnavailableError:
            rospy.logwarn("%s: %s; waiting for it", name, self._device.stats.last_error)
        self._thread = threading.Thread(target=self._scan, daemon=True)
        self._thread.start()
        rospy.on_shutdown(self._end)

    def _stats(self) -> LineStats:
        # A port that is closed because the node ends does not count as lost.
        if self._device is not None and not self._stop.is_set():
            self._last_stats = self._device.stats
        return self._last_stats

    def _use_parameters(self, parameters: ParameterSet) -> None:
        command = parameters.command()
        if self._device is None:
            self._device = self._make_device(parameters, self._stop, rospy.get_time)
        self._device.command = command

    def _scan(self) -> None:
        run, publish = guarded(self.health, self._device.run), guarded(self.health, self._publish)
        while not self._stop.is_set():
            run(publish)
            self._stop.wait(_PAUSE_AFTER_FAILURE)

    def _publish(self, ping: Any) -> None:
        # A ping leaves before its reply comes: with a clock near 0 its stamp is negative, which rospy.Time refuses.
        check_stamp(round(ping.stamp * 1e9))
        parameters = self._live.current
        message = self._message(ping, parameters)
        if message is not None:
            message.header.stamp, message.header.frame_id = rospy.Time.from_sec(ping.stamp), parameters.frame_id
            message.sensorAngle = self._tilt.for_beam()
            self._beams.publish(message)
            self.health.count("beams out")

    def _end(self) -> None:
        self._stop.set()
        self._thread.join(_LONGEST_STOP)


def scan_line(angle: float, echoes: bytes, range_resolution: float, gain: int) -> Optional[SonarScanLine]:
    """Return the message of a ping at `angle` rad with bins of `range_resolution` m, without header and sensorAngle;
    None if it holds no echoes.
    """
    if not echoes:
        return None
    return SonarScanLine(
        angle=angle, intensities=echoes, maxrange_meters=range_resolution * len(echoes),
        range_resolution=range_resolution, gain=gain,
    )  # fmt: skip


WORLD_FRAME = "world"
"""Frame of the world file that the emulated head hears."""
Place = Callable[[], Optional[np.ndarray]]
"""Returns the (4, 4) T_world_head of now; None where it is not known."""
WorldEchoes = Callable[[EmulatedHeadParameters, Optional[Place]], EchoSource]
"""Builds the simulator's echoes; passed in, because no driver may depend on the simulator."""
_MOST_ORDERED = 100000  # Hours of pings; more is a slip of the keyboard


class EmulatorNode:
    """Serves an emulated head until shutdown."""

    def __init__(
        self,
        name: str,
        parameters: Type[EmulatedHeadParameters],
        head: Type[EmulatedHead],
        line: Callable[[str], ServedLine],
        world_echoes: WorldEchoes,
    ) -> None:
        """Raises ParameterError for a bad parameter, and StartError when the world or the line cannot be made.

        line: makes the line of that link, not yet open.
        """
        self.health = make_health(name)
        self._faults: Optional[FaultInjector] = None
        self._live = ReconfigurableParameters(parameters, "~", self.health, self._use_parameters)
        current = self._live.current.changed({"link": os.path.expanduser(self._live.current.link)})
        made = head(current, self._echo_source(current, world_echoes), self._faults)
        self._served = ExitStack()
        try:
            self._served.enter_context(HeadServer(made, line(current.link)))
        except OSError as error:
            raise StartError(f"link = {current.link!r}: the port cannot be made: {error}") from error
        rospy.on_shutdown(self._served.close)
        rospy.Service("~order_fault", OrderFault, self._order)
        every(DIAGNOSTICS_PERIOD, self._show_counts, self.health)
        rospy.loginfo("%s: the head is at %s", name, current.link)

    def _echo_source(self, parameters: EmulatedHeadParameters, world_echoes: WorldEchoes) -> Optional[EchoSource]:
        if parameters.echo_source is EchoSourceKind.PATTERN:
            return None
        world_file = str(package_folder() / os.path.expanduser(parameters.world_file))
        place = partial(self._place, TfBuffer(self.health), parameters.head_frame) if parameters.head_frame else None
        return world_echoes(parameters.changed({"world_file": world_file}), place)

    def _place(self, transforms: TfBuffer, frame: str) -> Optional[np.ndarray]:
        """Return the newest (4, 4) T_world_frame; pings before tf knows it are counted."""
        found = transforms.newest(WORLD_FRAME, frame)
        if found is None:
            detail = f"tf does not know {frame!r} in {WORLD_FRAME!r}; check head_frame and who publishes it"
            self.health.problem("pings without a place", detail)
            return None
        return found[1]

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
