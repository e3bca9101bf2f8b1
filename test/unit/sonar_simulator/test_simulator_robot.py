"""The mount of the sonar in a URDF, and its servo."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from programs import ROOT

from node_support.errors import RefusedInput
from node_support.geometry import pose_matrix
from node_support.parameters import ParameterError
from sonar_simulator.simulation.robot import RobotDescription, Servo, ServoParameters, tilted

CHARLE = RobotDescription((ROOT / "urdf/charle.urdf").read_text())
CHAIN = """<robot name="r">
  <joint name="a" type="fixed"><parent link="base"/><child link="arm"/><origin xyz="1 0 0" rpy="0 0 1.5707963"/></joint>
  <joint name="b" type="revolute"><parent link="arm"/><child link="hand"/><origin xyz="2 0 0"/></joint>
  <joint name="c" type="fixed"><parent link="other"/><child link="base"/></joint>
</robot>"""


def test_charle_carries_a_sonar_on_a_servo_a_camera_and_thrusters_two_forward_and_two_up():
    np.testing.assert_allclose(CHARLE.mount("base_link", "sonar"), pose_matrix((0.4, 0.0, 0.2)))
    children = sorted(joint.child for joint in CHARLE.fixed_joints)
    assert children == ["camera", "thruster_bow", "thruster_port", "thruster_starboard", "thruster_stern"]
    ways = [CHARLE.mount("base_link", f"thruster_{name}")[:3, 0] for name in ("port", "starboard", "bow", "stern")]
    np.testing.assert_allclose(ways, [(1, 0, 0), (1, 0, 0), (0, 0, 1), (0, 0, 1)], atol=1e-4)


def test_a_mount_goes_through_all_joints_between():
    np.testing.assert_allclose(
        RobotDescription(CHAIN).mount("base", "hand"), pose_matrix((1, 2, 0), (0, 0, np.pi / 2)), atol=1e-6
    )


@pytest.mark.parametrize(
    ("urdf", "text"),
    [
        ("<robot", "not XML"),
        ('<robot><joint name="j"><parent link="a"/></joint></robot>', "joint j has no parent or no child"),
        (CHAIN.replace("2 0 0", "2 0 x"), "joint b: xyz = '2 0 x': must be three numbers"),
        (CHAIN.replace("2 0 0", "2 0"), "joint b: xyz = '2 0': must be three numbers"),
        ("<robot/>", "no joints lead from base to hand"),
        (CHAIN.replace('"other"', '"hand"'), "no joints lead from sonar to hand"),
    ],
)
def test_a_description_that_cannot_be_used_is_refused_with_what_is_wrong(urdf, text):
    with pytest.raises(ParameterError, match=text):
        RobotDescription(urdf).mount("sonar" if '"hand"/><child link="base"' in urdf else "base", "hand")


def _servo(**values):
    return Servo(ServoParameters(**values))


def test_it_turns_at_its_speed_and_stops_at_the_goal():
    servo = _servo(speed_deg=60.0)
    assert servo.angle(0.0) == 0.0
    servo.command(math.radians(-30.0))
    assert [math.degrees(servo.angle(time)) for time in (0.25, 0.5, 2.0)] == pytest.approx([-15.0, -30.0, -30.0])


@given(st.lists(st.tuples(st.floats(0.0, 2.0), st.floats(-10.0, 10.0)), min_size=1, max_size=20))
def test_it_is_never_faster_than_its_speed_nor_beyond_its_range(steps):
    servo, time, before = _servo(speed_deg=50.0, lowest_deg=-40.0, highest_deg=70.0), 0.0, 0.0
    for seconds, goal in steps:
        servo.command(goal)
        time += seconds
        angle = servo.angle(time)
        assert abs(angle - before) <= math.radians(50.0) * seconds + 1e-9
        assert math.radians(-40.0) <= angle <= math.radians(70.0)
        before = angle


def test_a_command_that_is_no_number_is_refused_and_the_goal_stays():
    servo = _servo()
    servo.command(0.2)
    with pytest.raises(RefusedInput, match="nan"):
        servo.command(math.nan)
    assert servo.angle(10.0) == pytest.approx(0.2)


def test_a_servo_without_range_is_refused():
    with pytest.raises(ParameterError, match="lowest_deg"):
        ServoParameters(lowest_deg=0.0, highest_deg=0.0)


def test_a_positive_angle_tilts_the_sonar_downwards():
    T_base_sonar = tilted(np.eye(4), math.radians(30.0))
    np.testing.assert_allclose(T_base_sonar[:3, 0], (math.cos(math.radians(30.0)), 0.0, -0.5), atol=1e-12)
