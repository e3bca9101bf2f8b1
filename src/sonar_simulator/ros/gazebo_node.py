"""gazebo_sonar: makes sonar beams from the scans of a ray sensor in Gazebo, so that no plugin has to be built."""

from typing import Optional

import genpy
import rospy

from node_support import topics
from node_support.ros.callbacks import guarded, make_health
from node_support.ros.transforms import JointAngle
from sonar_processing.beams.beam import PlacedBeam
from sonar_processing.ros.transform_filter import TransformFilter
from sonar_simulator.echoes.echo_model import make_echo_model
from sonar_simulator.gazebo.beams import GazeboBeams, RayScan
from sonar_simulator.gazebo.parameters import GROUPS, GazeboSonarParameters, HeadMode
from sonar_simulator.ros.gazebo_messages import ray_scan
from sonar_simulator.ros.simulator_messages import MESSAGES
from sonar_simulator.simulation.simulation import Ping
from sonar_simulator.simulation.sonar_head import SonarHead
from underwater_map_construction.msg import SonarScanLine

# A scan of 100,000 rays several times over; rospy reads one that is larger in pieces, slowly.
_SCAN_BUFFER_BYTES = 2**23
_ANY_TIME = 1.0  # s: Gazebo says when the next scan comes, so the head's own period does not count


class GazeboSonar:
    """Subscribes to sonar/rays, publishes sonar/raw."""

    def __init__(self) -> None:
        """Raises ParameterError."""
        self.health = make_health("gazebo_sonar")
        self.healths = [self.health]
        values = dict(rospy.get_param("~", {}))
        groups = {name: kind.from_group(name, values.pop(name, {})) for name, kind in GROUPS.items()}
        self._parameters = GazeboSonarParameters.from_mapping(values)
        name = self._parameters.echo_model
        self._beams = GazeboBeams(make_echo_model(name, groups[name].to_mapping()), self._parameters.seed)
        self._head = SonarHead(self._parameters.beams_per_turn, _ANY_TIME)
        self._next_beam = 0
        self._publisher = rospy.Publisher(topics.BEAMS, SonarScanLine, queue_size=100, tcp_nodelay=True)
        self._filter = self._make_filter()
        self._tilt = JointAngle(self._parameters.sensor_joint, self.health)
        rospy.Subscriber(
            topics.RAYS,
            rospy.AnyMsg,
            guarded(self.health, self._take_scan),
            queue_size=10,
            buff_size=_SCAN_BUFFER_BYTES,
            tcp_nodelay=True,
        )

    def _make_filter(self) -> Optional[TransformFilter]:
        if self._parameters.head is HeadMode.SWEEP:
            return None
        made = TransformFilter(self._parameters.frame_id, self.health, lambda: None, self._parameters.stamp_tolerance)
        made.registerCallback(guarded(self.health, self._turned))
        return made

    def _take_scan(self, message: rospy.AnyMsg) -> None:
        self.health.count("scans in")
        scan = ray_scan(message, self._parameters)
        if self._filter is not None:
            self._filter.add(scan)
            return
        with self.health.timed():
            ping = self._beams.swept(scan, self._head, self._next_beam, self._parameters.horizontal_opening)
        self._next_beam += 1
        self._publish(ping, scan)

    def _turned(self, placed: PlacedBeam) -> None:
        scan: RayScan = placed.beam
        with self.health.timed():
            ping = self._beams.turned(scan, placed.T_target_sonar)
        self._publish(ping, scan)

    def _publish(self, ping: Ping, scan: RayScan) -> None:
        stamp, frame = genpy.Time(*divmod(scan.stamp_ns, 10**9)), self._parameters.frame_id
        self._publisher.publish(MESSAGES.scan_line(ping, self._tilt.for_beam(), stamp, frame, self._beams.max_range))
        self.health.count("beams out")
