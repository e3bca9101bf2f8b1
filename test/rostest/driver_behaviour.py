"""What every sonar's driver does with an emulated head in a square basin."""

import math
from typing import Any, Callable, ClassVar, Dict, List

import numpy as np
import rospy
from driver_listener import ERROR, beams, diagnostics, level, values
from dynamic_reconfigure.client import Client
from graph import PACKAGE_ROOT, PATIENCE, ended
from sensor_msgs.msg import JointState

from underwater_map_construction.srv import OrderFault

PACKAGE = "underwater_map_construction"
# A ping that a change has not reached may be on its way, and one more may be ordered.
PINGS_BEFORE_A_CHANGE = 2


class DriverBehaviour:
    """Tests that a unittest.TestCase of one sonar inherits.

    sonar: the nodes' names are those of this sonar. defaults: set before each test. wall: m from the head to each of
    the basin's four walls. step: rad from beam to beam with the defaults.
    """

    sonar: ClassVar[str]
    defaults: ClassVar[Dict[str, Any]]
    wall: ClassVar[float]
    step: ClassVar[float]

    @classmethod
    def setUpClass(cls) -> None:
        """Connect with the driver and the emulated head."""
        cls.client = Client(f"{cls.sonar}_driver", timeout=PATIENCE)
        rospy.wait_for_service(f"{cls.sonar}_emulator/order_fault", PATIENCE)
        cls.order_fault = rospy.ServiceProxy(f"{cls.sonar}_emulator/order_fault", OrderFault)

    def setUp(self) -> None:
        """Begin with the defaults."""
        self.client.update_configuration(self.defaults)
        self.beams = beams()
        assert self.is_of_defaults(self.fresh_beams(1)[0])

    def is_of_defaults(self, beam: Any) -> bool:
        """Return whether a beam shows that the defaults hold."""
        raise NotImplementedError

    def fresh_beams(self, count: int) -> List[Any]:
        """Return the next `count` beams that know of every change until now.

        Beams and the answer of the service that changed something come on connections of their own: older beams may
        come after the answer.
        """
        now = rospy.Time.now()

        def fresh() -> List[Any]:
            return [beam for beam in self.beams.messages if beam.header.stamp > now][PINGS_BEFORE_A_CHANGE:]

        assert self.beams.wait(lambda _: len(fresh()) >= count), f"no {count} beams after {now.to_sec():.3f}"
        return fresh()[:count]

    def wait_for_beam(self, wanted: Callable[[Any], bool]) -> Any:
        """Return the newest beam once it is as wanted."""
        assert self.beams.wait(lambda received: bool(received) and wanted(received[-1]))
        return self.beams.messages[-1]

    @property
    def beams_per_turn(self) -> int:
        """Number of beams from one direction back to it."""
        return round(2.0 * math.pi / self.step)

    def assert_turns_by(self, step: float) -> None:
        """The head turns by `step` rad from each beam to the next one from now on."""
        angles = np.unwrap([beam.angle for beam in self.fresh_beams(10)])
        np.testing.assert_allclose(np.diff(angles), step, atol=1e-5)

    def test_a_full_turn_has_a_beam_at_every_step_clockwise(self) -> None:
        """And none is left out."""
        angles = np.unwrap([beam.angle for beam in self.fresh_beams(self.beams_per_turn + 1)])
        np.testing.assert_allclose(np.diff(angles), -self.step, atol=1e-5)

    def test_every_beam_of_a_turn_sees_its_wall(self) -> None:
        """As its strongest echo."""
        for beam in self.fresh_beams(self.beams_per_turn):
            wall = self.wall / max(abs(math.cos(beam.angle)), abs(math.sin(beam.angle)))
            strengths = np.frombuffer(beam.intensities, dtype=np.uint8)
            seen = (np.argmax(strengths) + 0.5) * beam.range_resolution
            assert abs(seen - wall) < 2 * beam.range_resolution

    def test_stamps_grow_and_are_of_now(self) -> None:
        """They are the times of the pings."""
        start = rospy.get_time()
        stamps = [beam.header.stamp.to_sec() for beam in self.fresh_beams(20)]
        assert np.all(np.diff(stamps) > 0)
        assert start < stamps[0]
        assert stamps[-1] < rospy.get_time()

    def test_an_inverted_head_is_mirrored(self) -> None:
        """It turns the other way."""
        self.client.update_configuration({"inverted": True})
        self.assert_turns_by(self.step)

    def test_the_tilt_of_the_head_is_that_of_its_joint(self) -> None:
        """Among others of the joint state."""
        joints = rospy.Publisher("joint_states", JointState, queue_size=1, latch=True)
        joints.publish(JointState(name=["rudder", "sonar_tilt"], position=[1.0, 0.3]))
        assert abs(self.wait_for_beam(lambda beam: beam.sensorAngle != 0.0).sensorAngle - 0.3) < 1e-6

    def test_scanning_goes_on_when_the_port_returns(self) -> None:
        """Until then the diagnostics report an error; how soon it goes on is shown in virtual time by unit tests."""
        health = diagnostics(f"{self.sonar}_driver")
        absence = rospy.get_param(f"{self.sonar}_emulator/absence_duration")
        last = self.beams.wait_for_more(1)[0].header.stamp.to_sec()
        assert self.order_fault("disappearance", 1).success
        assert health.wait(lambda arrays: any(level(array) == ERROR for array in arrays))
        self.wait_for_beam(lambda beam: beam.header.stamp.to_sec() > last + absence)
        gap = max(np.diff([beam.header.stamp.to_sec() for beam in self.beams.messages]))
        print(f"port gone for {absence:g} s, {gap - absence:.2f} s from its return to the next beam")
        assert gap > absence
        assert health.wait(lambda arrays: values(arrays[-1])["connected"] == "true")

    def start_driver(self, argument: str) -> List[str]:
        """Run a second driver until it ends with status 1; return the lines it printed."""
        command = [str(PACKAGE_ROOT / f"nodes/{self.sonar}_driver"), "__name:=second_driver", argument]
        done = ended(command)
        rospy.delete_param("second_driver")
        assert done.returncode == 1, done.stdout
        return done.stdout.splitlines()
