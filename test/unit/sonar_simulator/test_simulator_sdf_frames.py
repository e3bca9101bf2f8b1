import xml.etree.ElementTree as ET

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from node_support.geometry import pose_matrix
from sonar_simulator.world.sdf_geometry import Scope, own_pose
from sonar_simulator.world.world_file import load_sdf

NUMBERS = st.floats(-100.0, 100.0).map(lambda number: round(number, 6))
ANGLES = st.floats(-3.2, 3.2).map(lambda number: round(number, 6))
POSES = st.tuples(NUMBERS, NUMBERS, NUMBERS, ANGLES, ANGLES, ANGLES)
BOX = "<geometry><box><size>2 2 2</size></box></geometry>"


def _text(pose):
    return " ".join(map(repr, pose))


def _matrix(pose):
    return pose_matrix(pose[:3], pose[3:])


def _scope(*elements):
    warnings = []
    return Scope(ET.fromstring(f"<model>{''.join(elements)}</model>"), lambda *words: warnings.append(words)), warnings


@given(st.lists(POSES, min_size=1, max_size=5))
def test_poses_of_models_in_models_multiply(tmp_path_factory, poses):
    content = f'<link name="l"><collision name="c">{BOX}</collision></link>'
    for number, pose in enumerate(reversed(poses)):
        content = f'<model name="m{number}"><pose>{_text(pose)}</pose>{content}</model>'
    path = tmp_path_factory.getbasetemp() / "nested.sdf"
    path.write_text(f'<sdf version="1.6"><world name="w">{content}</world></sdf>')
    expected = np.linalg.multi_dot([np.eye(4), np.eye(4), *map(_matrix, poses)])
    np.testing.assert_allclose(load_sdf(path).world.shapes[0].pose, expected, atol=1e-9)


@given(POSES)
def test_a_pose_reads_as_it_is_written(pose):
    found = own_pose(ET.fromstring(f"<link><pose>{_text(pose)}</pose></link>"))
    np.testing.assert_allclose(found, _matrix(pose), rtol=0.0, atol=1e-12)


@given(POSES, POSES, POSES)
def test_a_pose_may_be_relative_to_a_sibling_that_is_relative_to_another(first, second, third):
    scope, warnings = _scope(
        f'<frame name="a"><pose>{_text(first)}</pose></frame>',
        f'<link name="b"><pose relative_to="a">{_text(second)}</pose></link>',
    )
    element = ET.fromstring(f'<link name="c"><pose relative_to="b">{_text(third)}</pose></link>')
    expected = _matrix(first) @ _matrix(second) @ _matrix(third)
    np.testing.assert_allclose(scope.pose(element, "c"), expected, atol=1e-9)
    assert warnings == []


def test_a_frame_stands_on_what_it_is_attached_to():
    scope, _ = _scope('<link name="l"><pose>1 2 3 0 0 0</pose></link>')
    frame = ET.fromstring('<frame name="f" attached_to="l"><pose>1 0 0 0 0 0</pose></frame>')
    np.testing.assert_array_equal(scope.pose(frame, "f")[:3, 3], (2, 2, 3))


def test_a_joint_stands_on_its_child():
    scope, _ = _scope('<link name="l"><pose>1 2 3 0 0 0</pose></link>')
    joint = ET.fromstring('<joint name="j"><child>l</child><pose>0 0 1 0 0 0</pose></joint>')
    np.testing.assert_array_equal(scope.pose(joint, "j")[:3, 3], (1, 2, 4))


def test_a_collision_relative_to_a_frame_does_not_move_with_its_link():
    scope, _ = _scope('<frame name="f"><pose>5 0 0 0 0 0</pose></frame>')
    collision = ET.fromstring('<collision name="c"><pose relative_to="f">1 0 0 0 0 0</pose></collision>')
    assert scope.pose_in_link(collision, "c", pose_matrix((0, 9, 0)))[:3, 3].tolist() == [6, 0, 0]


def test_degrees_are_degrees():
    pose = own_pose(ET.fromstring('<link><pose degrees="true">0 0 0 0 0 90</pose></link>'))
    np.testing.assert_allclose(pose[:3, 0], (0, 1, 0), atol=1e-12)


def test_an_empty_pose_is_none():
    np.testing.assert_array_equal(own_pose(ET.fromstring("<link><pose> </pose></link>")), np.eye(4))


def test_frames_in_a_ring_are_refused_with_their_name():
    scope, _ = _scope(
        '<frame name="a"><pose relative_to="b"/></frame>', '<frame name="b"><pose relative_to="a"/></frame>'
    )
    with pytest.raises(ValueError, match="relative to itself by way of 'a'"):
        scope.pose(ET.fromstring('<link name="l"><pose relative_to="a"/></link>'), "l")


def test_a_frame_that_is_not_there_is_a_warning_and_the_parent_is_taken():
    scope, warnings = _scope()
    scope.pose(ET.fromstring('<link name="l"><pose relative_to="gone">1 0 0 0 0 0</pose></link>'), "m/l")
    ((element, reason),) = warnings
    assert element == "m/l"
    assert "'gone'" in reason
