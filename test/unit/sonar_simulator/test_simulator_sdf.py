"""SDF worlds: frames, shapes, and what is wrong with them."""

import xml.etree.ElementTree as ET

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from programs import ROOT

from node_support.geometry import pose_matrix
from sonar_simulator.world.sdf_geometry import Scope, own_pose
from sonar_simulator.world.world import WorldError
from sonar_simulator.world.world_file import load_world

BASIN = ROOT / "worlds" / "basin.sdf"
BOX = "<geometry><box><size>2 2 2</size></box></geometry>"
BALL = "<geometry><sphere><radius>0.5</radius></sphere></geometry>"


BROKEN_MESHES = {
    "<uri>gone.stl</uri>": "gone.stl is not there",
    "<uri>model://gone/gone.dae</uri>": "model://gone/gone.dae is not there",
    "<uri>some.sdf</uri>": "must be one of .dae",
    "<uri>broken.stl</uri>": "broken.stl: no triangle in it",
    "<uri>t.obj</uri><scale>1 1</scale>": "<scale> is '1 1', must be 3 numbers",
    "<uri>t.obj</uri><submesh><name>keel</name></submesh>": "no mesh 'keel'",
    "": "no <uri>",
}
BROKEN_SHAPES = [
    *(f"<geometry><{kind}/></geometry>" for kind in ("heightmap", "polyline", "unheard_of")),
    *(f"<geometry><box><size>{size}</size></box></geometry>" for size in ("1 2", "1 2 x", "1 2 nan", "1 2 0")),
    "<geometry><cylinder><radius>1</radius></cylinder></geometry>",
    f"<pose>1 2 3</pose>{BOX}",
]


def _bad(shape):
    return _model(f'<collision name="bad">{shape}</collision>')


def _model(content, pose=""):
    return f'<model name="m">{pose}<link name="l">{content}</link></model>'


def test_poses_of_model_link_and_collision_nest(load):
    loaded = load(
        '<model name="m"><pose>10 0 0 0 0 1.5707963267948966</pose><link name="l"><pose>1 0 0 0 0 0</pose>'
        f'<collision name="c"><pose>0 2 3 0 0 0</pose>{BOX}</collision></link></model>'
    )
    (shape,) = loaded.shapes
    np.testing.assert_allclose(shape.pose[:3, 3], (8, 1, 3), atol=1e-12)
    np.testing.assert_allclose(shape.pose[:3, 0], (0, 1, 0), atol=1e-12)


@pytest.mark.parametrize(
    ("content", "kind"),
    [
        (f'<visual name="v">{BALL}</visual><collision name="c">{BOX}</collision>', "box"),
        (f'<visual name="v">{BALL}</visual>', "sphere"),
    ],
)
def test_a_link_is_seen_by_its_collisions_and_else_by_its_visuals(load, content, kind):
    assert [shape.kind for shape in load(_model(content)).shapes] == [kind]


@pytest.mark.parametrize(
    ("broken", "element", "reason"),
    [
        ("<include><uri>model://ship</uri></include>", "model://ship", "<include> model://ship is not there"),
        (_model(f'<collision name="c">{BOX}</collision>', "<pose>here</pose>"), "m", "<pose> is 'here'"),
        *((_bad(shape), "m/l/bad", "") for shape in BROKEN_SHAPES),
        *((_bad(f"<geometry><mesh>{mesh}</mesh></geometry>"), "m/l/bad", why) for mesh, why in BROKEN_MESHES.items()),
    ],
)
def test_what_is_broken_is_one_line_with_file_and_element_and_the_rest_loads(load, broken, element, reason):
    loaded = load(broken + _model(f'<collision name="c">{BOX}</collision>'))
    assert [shape.name for shape in loaded.shapes] == ["m/l/c"]
    (warning,) = loaded.warnings
    assert f"some.sdf: {element}: " in warning
    assert reason in warning
    assert "\n" not in warning


def test_an_unknown_version_is_a_warning(load):
    (warning,) = load(_model(f'<collision name="c">{BOX}</collision>'), "1.11").warnings
    assert "1.11" in warning


@pytest.mark.parametrize(
    ("text", "reason"), [(None, "No such file"), ("<sdf>", "not XML"), ("<robot/>", "not an SDF file")]
)
def test_a_file_that_is_no_sdf_is_refused_with_its_path(tmp_path, text, reason):
    path = tmp_path / "odd.world"
    if text is not None:
        path.write_text(text)
    with pytest.raises(WorldError, match=rf"odd\.world.*{reason}"):
        load_world(path)


def test_a_world_without_shapes_is_refused_and_says_what_was_left_out(load):
    with pytest.raises(WorldError, match=r"some\.sdf.*no box.*<image>"):
        load(_model('<collision name="c"><geometry><image/></geometry></collision>'))


def test_the_basin_is_120_by_50_by_5_5_m_inside():
    shapes = {shape.name: shape for shape in load_world(BASIN).shapes}
    assert shapes["basin/east_wall/box"].triangles()[0][:, 0].min() == 60.0
    assert shapes["basin/west_wall/box"].triangles()[0][:, 0].max() == -60.0
    assert shapes["basin/north_wall/box"].triangles()[0][:, 1].min() == 25.0
    assert shapes["basin/south_wall/box"].triangles()[0][:, 1].max() == -25.0
    assert shapes["basin/floor/box"].triangles()[0][:, 2].max() == -5.5


NUMBERS = st.floats(-100.0, 100.0).map(lambda number: round(number, 6))
ANGLES = st.floats(-3.2, 3.2).map(lambda number: round(number, 6))
POSES = st.tuples(NUMBERS, NUMBERS, NUMBERS, ANGLES, ANGLES, ANGLES)


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
    (shape,) = load_world(path).shapes
    np.testing.assert_allclose(shape.pose, expected, atol=1e-9)
    assert shape.name == "/".join([*(f"m{number}" for number in reversed(range(len(poses)))), "l/c"])


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


@pytest.mark.parametrize(
    ("element", "place"),
    [
        ('<frame name="f" attached_to="l"><pose>1 0 0 0 0 0</pose></frame>', (2, 2, 3)),
        ('<joint name="f"><child>l</child><pose>0 0 1 0 0 0</pose></joint>', (1, 2, 4)),
    ],
)
def test_a_frame_stands_on_what_it_is_attached_to_and_a_joint_on_its_child(element, place):
    scope, _ = _scope('<link name="l"><pose>1 2 3 0 0 0</pose></link>')
    np.testing.assert_array_equal(scope.pose(ET.fromstring(element), "f")[:3, 3], place)


def test_a_collision_relative_to_a_frame_does_not_move_with_its_link():
    scope, _ = _scope('<frame name="f"><pose>5 0 0 0 0 0</pose></frame>')
    collision = ET.fromstring('<collision name="c"><pose relative_to="f">1 0 0 0 0 0</pose></collision>')
    assert scope.pose_in_link(collision, "c", pose_matrix((0, 9, 0)))[:3, 3].tolist() == [6, 0, 0]


@pytest.mark.parametrize(
    ("text", "pose"),
    [('<pose degrees="true">0 0 0 0 0 90</pose>', (0, 0, 0, 0, 0, np.pi / 2)), ("<pose> </pose>", (0,) * 6)],
)
def test_a_pose_may_be_in_degrees_or_empty(text, pose):
    np.testing.assert_allclose(own_pose(ET.fromstring(f"<link>{text}</link>")), _matrix(pose), atol=1e-12)


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
