"""The pose of any frame in any other: as tf2 finds it, and where tf2 does not look."""

import warnings

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from recordings.motion.frame_tree import FrameTree
from recordings.motion.pose_track import PoseTrack

LEVEL = [0.0, 0.0, 0.0, 1.0]


def yawed(angle):
    return [0.0, 0.0, np.sin(angle / 2), np.cos(angle / 2)]


def seconds(*values):
    return np.array([round(value * 1e9) for value in values], dtype=np.int64)


def straight(start, end):
    """Return a track along x, with 1 m/s from `start` to `end` s."""
    return PoseTrack.sorted_from(seconds(start, end), [[start, 0, 0], [end, 0, 0]], [LEVEL, LEVEL])


def random_track(rng, count):
    stamps = np.cumsum(rng.integers(1, 5 * 10**8, count)) + 10**9
    turns = rng.normal(size=(count, 4))
    turns /= np.linalg.norm(turns, axis=1, keepdims=True)
    return PoseTrack.sorted_from(stamps, rng.normal(size=(count, 3)), turns)


def test_poses_that_are_none_are_left_out_and_the_first_of_a_stamp_counts():
    stamps, places = seconds(2, 1, 1, 3, 4, 5), [[2, 0, 0], [1, 0, 0], [9, 0, 0], [np.nan, 0, 0], *2 * [[4, 0, 0]]]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        track = PoseTrack.sorted_from(stamps, places, [*4 * [LEVEL], [0, 0, 0, 0], [0, 0, 0, 1e300]])
    assert track.translations[:, 0].tolist() == [1.0, 2.0]


def test_a_pose_beyond_what_is_known_is_not_known():
    tree = FrameTree({("odom", "base"): straight(1, 5)})
    _, known = tree.poses("odom", "base", seconds(0.9, 1, 5, 5.1))
    assert known.tolist() == [False, True, True, False]


def test_a_pose_that_never_changes_is_known_always():
    tree = FrameTree({("base", "sonar"): PoseTrack.fixed([1, 2, 3], yawed(np.pi / 2))})
    poses, known = tree.poses("base", "sonar", seconds(0, 1e9))
    assert known.all()
    assert poses[1] @ [1.0, 0.0, 0.0, 1.0] == pytest.approx([1.0, 3.0, 3.0, 1.0])


def test_a_frame_with_two_parents_is_found_through_the_right_one():
    """A second localisation in the bag must not hide the odometry."""
    tree = FrameTree({
        ("odom", "base"): straight(0, 9),
        ("world", "base"): PoseTrack.fixed([100, 0, 0], LEVEL),
        ("base", "sonar"): PoseTrack.fixed([1, 0, 0], LEVEL),
    })  # fmt: skip
    assert tree.poses("odom", "sonar", seconds(3))[0][0, 0, 3] == pytest.approx(4.0)


@pytest.mark.parametrize(
    ("target", "source", "reason"),
    [
        ("odom", "hull", "no transform names hull; there are base, odom, other, sonar"),
        ("odom", "sonar", "sonar and odom are not linked"),
        ("odom", "base", "base in odom is known from 1.00 to 5.00 s, not at 7.00 s"),
    ],
)
def test_what_is_missing_is_told(target, source, reason):
    tree = FrameTree({("odom", "base"): straight(1, 5), ("other", "sonar"): PoseTrack.fixed([0, 0, 0], LEVEL)})
    assert tree.why_not(target, source, seconds(2, 7)) == reason


@given(seed=st.integers(0, 10**6))
def test_poses_are_those_of_tf2(seed):
    tf2 = pytest.importorskip("tf2_py")
    rospy = pytest.importorskip("rospy")
    rng = np.random.default_rng(seed)
    links = {("odom", "base"): 6, ("base", "servo"): 9, ("servo", "sonar"): 3}
    tree = FrameTree({link: random_track(rng, count) for link, count in links.items()})
    buffer = tf2.BufferCore(rospy.Duration(10**6))
    for link, track in tree.tracks.items():
        for message in tf_messages(link, track):
            buffer.set_transform(message, "test")
    stamps = rng.integers(10**9, 4 * 10**9, 20)
    poses, known = tree.poses("odom", "sonar", stamps)
    back, _ = tree.poses("sonar", "odom", stamps)
    np.testing.assert_allclose((poses @ back)[known], np.tile(np.eye(4), (known.sum(), 1, 1)), atol=1e-9)
    for stamp, pose, is_known in zip(stamps, poses, known):
        try:
            found = buffer.lookup_transform_core("odom", "sonar", rospy.Time(*divmod(int(stamp), 10**9))).transform
        except tf2.ExtrapolationException:
            assert not is_known
            continue
        assert is_known
        rotation = np.array([found.rotation.x, found.rotation.y, found.rotation.z, found.rotation.w])
        expected = PoseTrack.fixed([found.translation.x, found.translation.y, found.translation.z], rotation)
        assert pose == pytest.approx(expected.at(seconds(0))[0], abs=1e-7)


def tf_messages(link, track):
    import rospy
    from geometry_msgs.msg import TransformStamped

    for stamp, translation, rotation in zip(track.stamps_ns, track.translations, track.rotations):
        message = TransformStamped(child_frame_id=link[1])
        message.header.stamp, message.header.frame_id = rospy.Time(*divmod(int(stamp), 10**9)), link[0]
        shift, turn = message.transform.translation, message.transform.rotation
        shift.x, shift.y, shift.z = translation
        turn.x, turn.y, turn.z, turn.w = rotation
        yield message
