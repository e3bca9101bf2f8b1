"""The ROS side of sonar_to_cloud: beams, tf and the velocity in, scans out (thesis 4.5.1, 6.5.2)."""

from typing import Callable, Optional

from node_support import topics
from node_support.ros.node import guarded, make_health
from node_support.ros.reconfigurable_parameters import LiveParameters
from sonar_processing.beams.placed_beam import PlacedBeam
from sonar_processing.cloud import IntensityCloud
from sonar_processing.ros.beam_subscriber import subscribe_to_beams
from sonar_processing.ros.cloud_publisher import CloudPublisher, PointsPublisher
from sonar_processing.ros.conversions import beam_from_message
from sonar_processing.ros.revolution_publisher import CloudTaker, TurnPublisher
from sonar_processing.ros.transform_filter import TransformFilter
from sonar_processing.ros.velocity_subscriber import subscribe_to_velocity
from sonar_processing.scans.assembler import ScanAssembler
from sonar_processing.scans.moving_state import Motion
from sonar_processing.scans.parameters import SonarToCloudParameters
from sonar_processing.scans.revolution_collector import TurnCollector
from underwater_map_construction.msg import SonarScanLine

Deliver = Callable[[IntensityCloud], None]


class SonarToCloud:
    """Subscribes to beams, publishes scans and hands them on where stages share the process."""

    def __init__(
        self, namespace: str = "~", deliver: Optional[Deliver] = None, polar_taker: Optional[CloudTaker] = None
    ) -> None:
        """`deliver` takes scans, `polar_taker` organised clouds of whole turns.

        Raises ParameterError for a bad parameter in `namespace`.
        """
        self.health = make_health("sonar_to_cloud")
        self._deliver = deliver
        self._motion = Motion()
        self._turn = TurnCollector()
        self._live = LiveParameters(
            SonarToCloudParameters, namespace, "SonarToCloud", self.health, self._use_parameters
        )
        self._scans = CloudPublisher(topics.SCANS)
        self._laser_scans = PointsPublisher(topics.LASER_POINTS)
        self._newest_beam = PointsPublisher(topics.NEWEST_BEAM)
        self._turns = TurnPublisher(self.health, polar_taker)
        parameters = self._live.current
        self._filter = TransformFilter(
            parameters.target_frame, self.health, self._forget_scan, parameters.stamp_tolerance
        )
        self._filter.registerCallback(guarded(self.health, self._place))
        subscribe_to_velocity(parameters.velocity_topic, parameters.velocity_type, self._motion, self.health)
        subscribe_to_beams(guarded(self.health, self._take_beam))

    def _use_parameters(self, parameters: SonarToCloudParameters) -> None:
        self._assembler = ScanAssembler(parameters)

    def _forget_scan(self) -> None:
        self._assembler.clear()
        self._turn.clear()

    def _take_beam(self, message: SonarScanLine) -> None:
        self.health.count("beams in")
        beam = beam_from_message(message)
        self.health.count("points in", beam.intensities.size)
        self._filter.add(self._live.current.corrected(beam), self._is_moving(beam.stamp_ns))

    def _is_moving(self, stamp_ns: int) -> bool:
        parameters = self._live.current
        if not self._motion.was_heard:
            self.health.show("velocity", f"never heard on {parameters.velocity_topic}: all beams count as still")
            return False
        moving, age = self._motion.is_moving(parameters), self._motion.age(stamp_ns)
        self.health.show("velocity", "moving" if moving else "still")
        if moving and age > parameters.velocity_timeout:
            self.health.problem(
                "beams of an old velocity", f"{parameters.velocity_topic} is silent for {age:.1f} s while moving"
            )
        return moving

    def _place(self, placed: PlacedBeam) -> None:
        parameters = self._live.current
        with self.health.timed():
            if self._newest_beam.is_read:
                self._newest_beam.publish(self._assembler.project(placed))
            scan = self._assembler.add(placed)
            turn = self._turn.add(placed)
        self.health.count("beams placed")
        if scan is not None:
            self._publish(scan)
        if turn is not None:
            self._turns.publish(turn, parameters)

    def _publish(self, scan: IntensityCloud) -> None:
        self.health.count("scans")
        self.health.count("points out", len(scan))
        self._scans.publish(scan)
        if self._live.current.mode.is_laser:
            self._laser_scans.publish(scan)
        if self._deliver is not None:
            self._deliver(scan)
