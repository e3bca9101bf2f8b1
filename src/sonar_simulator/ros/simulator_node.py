"""The simulator as a node: publishes /clock, odometry, tf and the sonar's beams."""

import itertools
import math
import threading
import time
from typing import Iterator

import numpy as np
import rospy
from geometry_msgs.msg import Twist
from std_msgs.msg import Float64

from node_support import topics
from node_support.files import package_folder
from node_support.parameters import ParameterError
from node_support.ros.callbacks import guarded, make_health
from node_support.ros.node import run
from node_support.timing import Pace, UsualInterval
from sonar_simulator.ros.publisher import SimulatorPublisher
from sonar_simulator.simulation.robot import RobotDescription
from sonar_simulator.simulation.simulation import Drive, Moment, Settings, Simulation
from underwater_map_construction.msg import StampedIntensityCloud

START_TIME = 1000.0  # s: stamps before it, as of late transforms, are still above 0
_WAIT_STEP = 0.05  # s: of the clock while the simulation waits for a listener
_LISTENER_TIME = 0.5  # s: who subscribes to the beams has told the master its other topics within this time
_LONGEST_START = 10.0  # s: who is not connected by then has ended
_LONGEST_WAIT = 60.0  # s: of the wall clock for echoes that are overdue; who needs longer sends none any more
_LOOK = 0.5  # s: of the wall clock between two looks whether their sender has ended
_BEAMS_AT_ONCE = 9  # a quarter of the work of each by itself; more would save little, and let the clock stand


class Echoes:
    """Knows from the echoes that come back whether their listeners keep pace; without any, nobody is waited for."""

    def __init__(self) -> None:
        self._interval = UsualInterval()
        self._condition = threading.Condition()
        self._awaited = False
        self._subscriber = rospy.Subscriber(topics.ECHOES, StampedIntensityCloud, self._take, queue_size=10)

    def _take(self, echoes: StampedIntensityCloud) -> None:
        with self._condition:
            self._interval.take(echoes.header.stamp.to_sec())
            self._awaited = True
            self._condition.notify()

    def wait_for(self, stamp: float) -> None:
        """Wait while echoes are overdue at `stamp` [s]; not for a sender that has ended or is silent, until it sends.

        On a busy machine one that lives needs long: if time went on without it, it would never catch up.
        """
        end = time.monotonic() + _LONGEST_WAIT
        with self._condition:
            while self._awaited and self._interval.overdue(stamp):
                if not self._condition.wait(_LOOK):
                    self._awaited = self._subscriber.get_num_connections() > 0 and time.monotonic() < end


class Simulator:
    """Runs a simulation against the wall clock, `real_time_factor` times as fast."""

    def __init__(self) -> None:
        """Raises ParameterError if a parameter, the world, the script or the robot's description cannot be used."""
        self.health = make_health("sonar_simulator")
        settings = Settings.from_mapping(rospy.get_param("~", {}))
        self._parameters = settings.simulator
        self._simulation = Simulation(settings, package_folder(), _robot(), lambda line: rospy.logwarn("%s", line))
        self._publisher = SimulatorPublisher(self._simulation, settings.simulator)
        self._echoes = Echoes()
        self._start_time = START_TIME
        self._now = 0.0
        self._lock = threading.Lock()
        self._ended = threading.Event()
        rospy.on_shutdown(self._ended.set)
        self._subscribe()
        threading.Thread(target=guarded(self.health, self._run), daemon=True).start()

    def _subscribe(self) -> None:
        commands = {topics.SERVO_COMMANDS: (Float64, self._take_servo_command)}
        if self._parameters.drive is Drive.COMMANDS:
            commands[topics.VELOCITY_COMMANDS] = (Twist, self._take_velocity_command)
        self._commands = [
            rospy.Subscriber(topic, kind, guarded(self.health, take), queue_size=10, tcp_nodelay=True)
            for topic, (kind, take) in commands.items()
        ]

    def _take_servo_command(self, command: Float64) -> None:
        with self._lock:
            self._simulation.servo.command(command.data)

    def _take_velocity_command(self, command: Twist) -> None:
        linear, angular = command.linear, command.angular
        twist = np.array([linear.x, linear.y, linear.z, angular.x, angular.y, angular.z])
        self.health.count("velocity commands")
        with self._lock:
            limited = self._simulation.commanded.command(self._now, twist)
        self.health.count("velocity commands limited", int(limited))

    def _run(self) -> None:
        if self._parameters.wait_for_listener and self._parameters.drive is Drive.SCRIPT:
            self._wait_for_listener()
        simulation, rate = self._simulation, self._parameters.clock_rate
        pace = Pace(self._parameters.real_time_factor, self._ended.wait)
        moments = simulation.moments(rate, self._beams_at_once())
        while self._play(moments, pace):
            self._publisher.publish_progress(self._now / simulation.duration)
        if self._ended.is_set():
            return
        self._publisher.publish_progress(1.0)
        name = self.health.name
        rospy.loginfo("%s: the moves have ended after %.0f s; the map stays, Ctrl-C ends it", name, self._now)
        rest = (simulation.moment(tick / rate) for tick in itertools.count(math.floor(self._now * rate) + 1))
        while self._play(rest, pace):
            pass

    def _beams_at_once(self) -> int:
        """Return how many beams are cast together: where somebody may command, each by itself, as it obeys at once."""
        is_commanded = self._parameters.drive is Drive.COMMANDS
        return 1 if is_commanded or any(one.get_num_connections() for one in self._commands) else _BEAMS_AT_ONCE

    def _play(self, moments: Iterator[Moment], pace: Pace) -> bool:
        """Publish the next moment when its time has come; return False if there is none or the node ends."""
        with self._lock, self.health.timed():
            moment = next(moments, None)
        if moment is None or self._ended.is_set():
            return False
        self._keep_pace(moment, pace)
        if self._ended.is_set():
            return False
        self._publisher.publish(moment, rospy.Time.from_sec(self._start_time + moment.time))
        self._now = moment.time
        self.health.count("moments")
        self.health.count("beams out", int(moment.ping is not None))
        return True

    def _keep_pace(self, moment: Moment, pace: Pace) -> None:
        self._echoes.wait_for(self._start_time + moment.time)
        if pace.wait_for(moment.time):
            factor = self._parameters.real_time_factor
            detail = f"{pace.lost:.1f} s in all: the machine cannot keep up with real_time_factor {factor:g}"
            self.health.problem("delays", detail)

    def _wait_for_listener(self) -> None:
        """Let the clock run until somebody subscribes to the beams, and all who subscribe have been connected."""
        start, waited = self._simulation.moment(0.0), 0.0
        while waited < _LONGEST_START and not self._ended.wait(_WAIT_STEP):
            waited += _WAIT_STEP if self._publisher.has_listener else 0.0
            self._publisher.publish_rest(start, rospy.Time.from_sec(self._start_time))
            self._start_time += _WAIT_STEP
            if waited >= _LISTENER_TIME and not self._publisher.lacks_listeners():
                return


def _robot() -> RobotDescription:
    try:
        return RobotDescription(rospy.get_param("robot_description"))
    except KeyError as error:
        raise ParameterError("robot_description is not set; the simulator reads the sonar's mount from it") from error


def run_simulator() -> None:
    run("sonar_simulator", Simulator)
