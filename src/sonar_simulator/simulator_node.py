"""The simulator as a node: it is the clock, the odometry, tf and the sonar."""

import math
import os
import threading
import time
from typing import Any, Callable, Dict

import numpy as np
import rospkg
import rospy
import tf2_ros
from std_msgs.msg import Float64

from node_support.node import guarded, make_health
from node_support.parameters import ParameterError
from node_support.refused_input import RefusedInput
from sonar_processing.transforms import matrix_from_message
from sonar_simulator.default_yaml import GROUPS
from sonar_simulator.echo_model import make_echo_model
from sonar_simulator.odometry import Odometry, OdometryParameters
from sonar_simulator.ray_caster import RayCaster
from sonar_simulator.script_file import load_script
from sonar_simulator.sdf import WorldError, load_sdf
from sonar_simulator.servo import Servo, ServoParameters
from sonar_simulator.simulation import Simulation, SimulatorParameters
from sonar_simulator.simulator_messages import BASE_FRAME, SONAR_FRAME
from sonar_simulator.simulator_publisher import SimulatorPublisher
from sonar_simulator.sonar_head import Sonar, SonarHead, SonarParameters
from sonar_simulator.vehicle import ScriptError

PACKAGE = "underwater_map_construction"
START_TIME = 1000.0
MOUNT_TIMEOUT = 20.0
_WAIT_STEP = 0.05


class Simulator:
    """Runs a script against the wall clock, `real_time_factor` times as fast."""

    def __init__(self) -> None:
        """Raises ParameterError when a parameter, the world or the script cannot be used."""
        self.health = make_health("sonar_simulator")
        values = dict(rospy.get_param("~", {}))
        groups: Dict[str, Any] = {name: values.pop(name, {}) for name in GROUPS}
        self._parameters = SimulatorParameters.from_mapping(values)
        self._sonar_parameters = SonarParameters.from_mapping(groups["sonar"])
        self._odometry_parameters = OdometryParameters.from_mapping(groups["odometry"])
        model = make_echo_model(self._parameters.echo_model, groups["echo"])
        rng = np.random.default_rng(self._parameters.seed)
        self._script = _loaded(load_script, self._parameters.script)
        self._sonar = Sonar(RayCaster(self._load_world()), self._sonar_parameters.pattern(), model, rng)
        self._servo = Servo(ServoParameters.from_mapping(groups["servo"]))
        self._publisher = SimulatorPublisher(self._sonar.max_range)
        rospy.Subscriber("sonar_servo/command", Float64, guarded(self.health, self._take_servo_command), queue_size=10)
        self._start_time = START_TIME
        threading.Thread(target=guarded(self.health, self._run), daemon=True).start()

    def _take_servo_command(self, command: Float64) -> None:
        self._servo.command(command.data)

    def _load_world(self) -> object:
        loaded = _loaded(load_sdf, self._parameters.world)
        for warning in loaded.warnings:
            rospy.logwarn("%s", warning)
        return loaded.world

    def _run(self) -> None:
        parameters, head = self._parameters, self._sonar_parameters
        simulation = Simulation(
            self._script,
            Odometry(self._odometry_parameters, self._script.pose(0.0)),
            self._sonar,
            SonarHead(head.beams_per_turn, head.seconds_per_turn),
            self._sonar_mount(),
            self._servo,
        )
        if self._parameters.wait_for_listener:
            self._wait(lambda: self._publisher.has_listener)
        start = time.monotonic()
        for moment in simulation.moments(parameters.clock_rate):
            self._pace(start + moment.time / parameters.real_time_factor)
            if rospy.core.is_shutdown_requested():
                return
            self._publisher.publish(moment, self._stamp(moment.time))
            self._publisher.publish_progress(moment.time / simulation.duration)
            self.health.count("moments")
            self.health.count("beams out", int(moment.ping is not None))
        self._publisher.publish_progress(1.0)
        self._stand_still(simulation, start)

    def _wait(self, ready: Callable[[], bool], timeout: float = math.inf) -> bool:
        """Let the clock run until something is ready: robot_state_publisher, for one, stands still without it."""
        deadline = time.monotonic() + timeout
        while not ready() and time.monotonic() < deadline and not rospy.core.is_shutdown_requested():
            time.sleep(_WAIT_STEP)
            self._start_time += _WAIT_STEP
            self._publisher.publish_rest(rospy.Time.from_sec(self._start_time))
        return ready()

    def _sonar_mount(self) -> np.ndarray:
        """Return T_base_sonar as the robot's description gives it, with the servo at 0."""
        buffer = tf2_ros.Buffer(debug=False)
        listener = tf2_ros.TransformListener(buffer)
        if not self._wait(lambda: buffer.can_transform_core(BASE_FRAME, SONAR_FRAME, rospy.Time(0))[0], MOUNT_TIMEOUT):
            raise RefusedInput(
                "robots without sonar", f"tf knows no {SONAR_FRAME} on {BASE_FRAME}; see robot_description"
            )
        transform = buffer.lookup_transform_core(BASE_FRAME, SONAR_FRAME, rospy.Time(0)).transform
        listener.unregister()
        return matrix_from_message(transform)

    def _stand_still(self, simulation: Simulation, start: float) -> None:
        rate, factor = self._parameters.clock_rate, self._parameters.real_time_factor
        tick = int(simulation.duration * rate) + 1
        while not rospy.core.is_shutdown_requested():
            self._pace(start + tick / rate / factor)
            self._publisher.publish(simulation.moment(tick / rate), self._stamp(tick / rate))
            tick += 1

    def _stamp(self, seconds: float) -> rospy.Time:
        return rospy.Time.from_sec(self._start_time + seconds)

    def _pace(self, when: float) -> None:
        behind = time.monotonic() - when
        if behind > 1.0:
            self.health.show("behind schedule [s]", f"{behind:.1f}")
        elif behind < 0.0:
            time.sleep(-behind)


def _loaded(load: Any, path: str) -> Any:
    absolute = os.path.join(rospkg.RosPack().get_path(PACKAGE), os.path.expanduser(path))
    try:
        return load(absolute)
    except (WorldError, ScriptError) as error:
        raise ParameterError(str(error)) from error
