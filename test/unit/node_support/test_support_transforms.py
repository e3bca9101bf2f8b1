"""Where frames and joints are, on tf2 itself. No ROS master is needed: messages are handed to callbacks."""

import math

import numpy as np
import pytest
import rospy
from geometry_msgs.msg import TransformStamped
from sensor_msgs.msg import JointState
from tf2_msgs.msg import TFMessage

from node_support.errors import RefusedInput
from node_support.health import Health
from node_support.ros.transforms import JointAngle, TfBuffer

SECOND = 10**9
CLOCK = 1_700_000_000.0


def transform(seconds, x=0.0, child="base_link", parent="odom", w=1.0):
    message = TransformStamped(child_frame_id=child)
    message.header.frame_id = parent
    message.header.stamp = rospy.Time(*divmod(int(seconds * SECOND), SECOND))
    message.transform.translation.x = x
    message.transform.rotation.w = w
    return message


class Tf:
    """A buffer, what it warns of, and a way to send it transforms."""

    def __init__(self, monkeypatch):
        self.topics = {}
        monkeypatch.setattr(rospy, "Subscriber", lambda topic, _, take, **__: self.topics.update({topic: take}))
        monkeypatch.setattr(rospy.rostime, "_rostime_initialized", True)
        monkeypatch.setattr(rospy.rostime, "_rostime_current", rospy.Time(int(CLOCK)))
        self.health = Health("test", lambda line: None)
        self.buffer = TfBuffer(self.health)

    def send(self, *transforms, topic="/tf"):
        message = TFMessage(transforms=list(transforms))
        message._connection_header = {"callerid": "/test"}
        self.topics[topic](message)

    def x(self, seconds, source="base_link"):
        return self.buffer.matrix("odom", source, int(seconds * SECOND))[0, 3]

    @property
    def refused(self):
        values = self.health.report().values
        return int(values.get("transforms refused", 0)) + int(values.get("stamps refused", 0))


@pytest.fixture
def tf(monkeypatch):
    return Tf(monkeypatch)


def test_a_transform_is_interpolated_at_its_stamp(tf):
    tf.send(transform(CLOCK, x=1.0), transform(CLOCK + 1.0, x=3.0))
    assert tf.x(CLOCK + 0.5) == pytest.approx(2.0)
    assert tf.refused == 0


def test_what_tf_does_not_know_is_told_with_its_reason(tf):
    tf.send(transform(CLOCK))
    assert "nowhere" in tf.buffer.obstacle("odom", "nowhere", int(CLOCK * SECOND))
    with pytest.raises(RefusedInput, match="nowhere"):
        tf.x(CLOCK, source="nowhere")


def test_a_clock_that_stands_while_a_frame_moves_is_counted_once_and_known_by_when_it_goes_on(tf):
    for x in range(9):
        tf.send(transform(CLOCK, x=float(x)))
    assert tf.buffer.clock.stands_at(int(CLOCK * SECOND))
    tf.send(transform(CLOCK + 1.0, x=9.0))
    assert not tf.buffer.clock.stands_at(int((CLOCK + 1.0) * SECOND))
    assert list(tf.buffer.clock.stood) == [(CLOCK, CLOCK + 1.0)]
    assert tf.health.report().values["clocks that stood while the vehicle moved"] == "1"


def test_a_vehicle_at_rest_whose_transform_is_sent_again_and_again_has_no_clock_that_stands(tf):
    for _ in range(20):
        tf.send(transform(CLOCK, x=1.0))
    tf.send(transform(CLOCK + 1.0, x=1.0))
    assert not tf.buffer.clock.stood


@pytest.mark.parametrize("seconds", [0.0, 2.0**31 - 1e-9, 2.0**31, 4294967295.9])
def test_a_stamp_that_would_end_the_process_reaches_tf2_neither_as_question_nor_as_transform(tf, seconds):
    tf.send(transform(CLOCK, x=1.0))
    tf.send(transform(seconds))
    assert tf.refused == 1
    with pytest.raises(RefusedInput, match="must be above 0 and below"):
        tf.x(seconds)
    with pytest.raises(RefusedInput, match="must be above 0 and below"):
        tf.buffer.check_stamp(int(seconds * SECOND))
    assert tf.x(CLOCK) == 1.0


def test_a_single_transform_of_another_year_is_refused(tf):
    tf.send(transform(CLOCK, x=1.0), transform(CLOCK + 1e7), transform(CLOCK + 1.0, x=2.0))
    assert tf.refused == 1
    assert tf.x(CLOCK + 1.0) == 2.0


def test_a_recording_of_another_year_is_believed_with_its_odometry(tf):
    recorded = CLOCK - 3e8
    with pytest.raises(RefusedInput, match="stamp_tolerance"):
        tf.buffer.check_stamp(int(recorded * SECOND))
    tf.send(transform(recorded), transform(recorded + 0.1))
    tf.buffer.check_stamp(int(recorded * SECOND))
    assert tf.refused == 0


def test_a_jump_back_forgets_what_was_later(tf):
    tf.send(transform(CLOCK + 100.0, x=5.0))
    tf.send(transform(CLOCK, x=1.0), transform(CLOCK + 1.0, x=2.0))
    assert tf.x(CLOCK + 1.0) == 2.0
    assert tf.buffer.obstacle("odom", "base_link", int((CLOCK + 100.0) * SECOND))


def test_a_transform_that_was_overtaken_forgets_nothing(tf):
    tf.send(transform(CLOCK + 0.5, x=5.0), transform(CLOCK, x=1.0))
    assert (tf.x(CLOCK + 0.5), tf.x(CLOCK)) == (5.0, 1.0)


@pytest.mark.parametrize(
    "bad",
    [
        *({"x": math.nan}, {"x": math.inf}, {"w": 0.0}, {"w": math.nan}),
        *({"child": ""}, {"child": "odom"}, {"child": "base\0link"}, {"parent": ""}),
    ],
)
def test_a_transform_that_tf2_cannot_take_is_counted_and_the_next_of_its_message_is_taken(tf, bad):
    tf.send(transform(CLOCK, **bad), transform(CLOCK, x=2.0))
    assert tf.refused == 1
    assert tf.x(CLOCK) == 2.0


@pytest.mark.parametrize(("parent", "taken"), [("", "elsewhere"), ("odom", "odom")])
def test_of_two_parents_the_named_one_is_taken_or_the_first(tf, parent, taken):
    buffer = TfBuffer(tf.health, parent=parent)
    for seconds in range(4):
        for other in ("elsewhere", "odom"):
            tf.send(transform(CLOCK + seconds, x=1.0, parent=other))
    assert buffer.obstacle(taken, "base_link", int((CLOCK + 2.0) * SECOND)) == ""
    (refused,) = {"elsewhere", "odom"} - {taken}
    assert buffer.obstacle(refused, "base_link", int((CLOCK + 2.0) * SECOND))
    assert int(tf.health.report().values["transforms of a second parent"]) >= 3


def test_a_static_transform_holds_at_any_time_whatever_its_stamp(tf):
    tf.send(transform(4294967295.0, x=4.0, child="sonar"), topic="/tf_static")
    assert tf.x(CLOCK, source="sonar") == 4.0
    stamp_ns, T_odom_sonar = tf.buffer.newest("odom", "sonar")
    assert stamp_ns == 0
    assert np.allclose(T_odom_sonar[:3, 3], [4.0, 0.0, 0.0])


def test_frames_without_end_do_not_fill_the_memory(tf):
    tf.send(*(transform(CLOCK, child=f"frame{number}") for number in range(1001)))
    assert tf.refused == 1


def test_waiting_ends_with_what_is_in_the_way(tf):
    assert "base_link" in tf.buffer.wait_for("odom", "base_link", int(CLOCK * SECOND), patience=0.01)
    tf.send(transform(CLOCK))
    assert tf.buffer.wait_for("odom", "base_link", int(CLOCK * SECOND), patience=60.0) == ""


class Servo:
    """The angle of a joint, what was told of it, and what hands it messages."""

    def __init__(self, monkeypatch):
        monkeypatch.setattr(rospy, "Subscriber", lambda topic, kind, take, **_: setattr(self, "take", take))
        self.warnings, self.angles = [], []
        self.joint = JointAngle("servo", Health("test", self.warnings.append), self.angles.append)

    def send(self, **angles):
        self.take(JointState(name=list(angles), position=list(angles.values())))


@pytest.fixture
def servo(monkeypatch):
    return Servo(monkeypatch)


def test_the_newest_angle_of_the_joint_is_told(servo):
    servo.send(other=0.1, servo=0.2)
    servo.send(other=0.3)
    assert (servo.joint.for_beam(), servo.angles, servo.warnings) == (0.2, [0.2], [])


def test_an_angle_that_is_not_finite_is_refused(servo):
    servo.send(servo=0.2)
    servo.send(servo=math.nan)
    assert (servo.joint.for_beam(), servo.angles) == (0.2, [0.2])
    assert "joint states refused" in servo.warnings[0]


def test_beams_before_the_first_angle_are_counted_but_not_without_a_joint(servo):
    assert JointAngle("", servo.joint._health).for_beam() == 0.0
    assert servo.warnings == []
    assert servo.joint.for_beam() == 0.0
    assert "beams of unknown tilt" in servo.warnings[0]
