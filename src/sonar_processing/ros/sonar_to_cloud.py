"""The ROS side of sonar_to_cloud: beams, tf and the velocity in, scans out (thesis 4.5.1, 6.5.2)."""

from typing import Optional

from node_support import topics
from node_support.ros.callbacks import guarded, make_health
from node_support.ros.reconfigurable_parameters import ReconfigurableParameters
from sonar_processing.beams.beam import Beam
from sonar_processing.beams.head_watch import HeadWatch
from sonar_processing.beams.placed_beam import PlacedBeam
from sonar_processing.cloud import IntensityCloud
from sonar_processing.cloud_sink import CloudSink
from sonar_processing.ros.beam_subscriber import BeamSubscriber
from sonar_processing.ros.publishers import CloudPublisher, PointsPublisher
from sonar_processing.ros.revolution_publisher import RevolutionPublisher
from sonar_processing.ros.sonar_mount import SonarMount
from sonar_processing.ros.subscribers import subscribe_to_velocity
from sonar_processing.ros.transform_filter import TransformFilter
from sonar_processing.scans.assembler import ScanAssembler
from sonar_processing.scans.moving_state import MovingState
from sonar_processing.scans.parameters import SonarToCloudParameters
from sonar_processing.scans.revolution_collector import RevolutionCollector


class SonarToCloud:
    """Subscribes to beams, publishes scans and hands them on where stages share the process."""

    def __init__(
        self, namespace: str = "~", scan_sink: Optional[CloudSink] = None, polar_sink: Optional[CloudSink] = None
    ) -> None:
        """`scan_sink` takes scans, `polar_sink` organised clouds of whole revolutions.

        Raises ParameterError for a bad parameter in `namespace`.
        """
        self.health = make_health("sonar_to_cloud")
        self.healths = [self.health]
        self._scan_sink = scan_sink
        self._moving_state = MovingState()
        self._revolution = RevolutionCollector()
        self._head = HeadWatch()
        self._live = ReconfigurableParameters(
            SonarToCloudParameters, namespace, "SonarToCloud", self.health, self._use_parameters
        )
        self._scans = CloudPublisher(topics.SCANS)
        self._laser_scans = PointsPublisher(topics.LASER_POINTS)
        self._newest_beam = PointsPublisher(topics.NEWEST_BEAM)
        self._revolutions = RevolutionPublisher(self.health, polar_sink)
        parameters = self._live.current
        mount = SonarMount(parameters, self.health.name)
        self._filter = TransformFilter(
            parameters.target_frame, self.health, self._forget_scan, parameters.stamp_tolerance, mount
        )
        self._filter.registerCallback(guarded(self.health, self._place))
        subscribe_to_velocity(parameters.velocity_topic, parameters.velocity_type, self._moving_state, self.health)
        BeamSubscriber(self._take_beam, parameters, self.health, self._filter.forget, self._filter.make_room)

    def _use_parameters(self, parameters: SonarToCloudParameters) -> None:
        self._assembler = ScanAssembler(parameters)

    def _forget_scan(self) -> None:
        self._assembler.clear()
        self._revolution.clear()

    def _take_beam(self, beam: Beam) -> None:
        self.health.count("points in", beam.intensities.size)
        for event, number in self._head.add(beam).items():
            self.health.count(event.value, number)
        self._filter.add(self._live.current.corrected(beam), self._is_moving(beam.stamp_ns))

    def _is_moving(self, stamp_ns: int) -> bool:
        parameters = self._live.current
        if not self._moving_state.was_heard:
            self.health.show("velocity", f"nothing received on {parameters.velocity_topic}: all beams count as still")
            return False
        moving, age = self._moving_state.is_moving(parameters), self._moving_state.age(stamp_ns)
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
            revolution = self._revolution.add(placed)
        self.health.count("beams placed")
        if scan is not None:
            self._publish(scan)
        if revolution is not None:
            self._revolutions.publish(revolution, parameters)

    def _publish(self, scan: IntensityCloud) -> None:
        self.health.count("scans")
        self.health.count("points out", len(scan))
        self._scans.publish(scan)
        if self._live.current.mode.is_laser:
            self._laser_scans.publish(scan)
        if self._scan_sink is not None:
            self._scan_sink.take(scan)
