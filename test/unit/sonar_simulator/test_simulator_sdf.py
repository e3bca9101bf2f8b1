from pathlib import Path

import numpy as np
import pytest

from sonar_simulator.world.world import WorldError
from sonar_simulator.world.world_file import load_sdf

BASIN = Path(__file__).resolve().parents[3] / "worlds" / "basin.sdf"
BOX = "<geometry><box><size>2 2 2</size></box></geometry>"
BALL = "<geometry><sphere><radius>0.5</radius></sphere></geometry>"


@pytest.fixture
def load(tmp_path):
    def load_text(content, version="1.6"):
        path = tmp_path / "some.sdf"
        path.write_text(f'<sdf version="{version}"><world name="here">{content}</world></sdf>')
        return load_sdf(path)

    return load_text


def _model(content, pose=""):
    return f'<model name="m">{pose}<link name="l">{content}</link></model>'


def test_poses_of_model_link_and_collision_nest(load):
    loaded = load(
        '<model name="m"><pose>10 0 0 0 0 1.5707963267948966</pose><link name="l"><pose>1 0 0 0 0 0</pose>'
        f'<collision name="c"><pose>0 2 3 0 0 0</pose>{BOX}</collision></link></model>'
    )
    (shape,) = loaded.world.shapes
    np.testing.assert_allclose(shape.pose[:3, 3], (8, 1, 3), atol=1e-12)
    np.testing.assert_allclose(shape.pose[:3, 0], (0, 1, 0), atol=1e-12)


def test_roll_pitch_yaw_turn_about_fixed_axes(load):
    quarter = np.pi / 2
    pose = f"<pose>0 0 0 {quarter} 0 {quarter}</pose>"
    (shape,) = load(_model(f'<collision name="c">{BOX}</collision>', pose)).world.shapes
    np.testing.assert_allclose(shape.pose[:3, :3] @ (0, 1, 0), (0, 0, 1), atol=1e-12)
    np.testing.assert_allclose(shape.pose[:3, :3] @ (1, 0, 0), (0, 1, 0), atol=1e-12)


def test_nested_models_are_placed_in_their_parent(load):
    link = f'<link name="l"><collision name="c">{BOX}</collision></link>'
    inner = f'<model name="in"><pose>0 1 0 0 0 0</pose>{link}</model>'
    (shape,) = load(f'<model name="out"><pose>1 0 0 0 0 0</pose>{inner}</model>').world.shapes
    np.testing.assert_allclose(shape.pose[:3, 3], (1, 1, 0))
    assert shape.name == "out/in/l/c"


def test_collisions_are_taken_before_visuals(load):
    both = f'<visual name="v">{BALL}</visual><collision name="c">{BOX}</collision>'
    assert [shape.kind for shape in load(_model(both)).world.shapes] == ["box"]


def test_a_link_without_collision_is_seen_by_its_visuals(load):
    assert [shape.kind for shape in load(_model(f'<visual name="v">{BALL}</visual>')).world.shapes] == ["sphere"]


@pytest.mark.parametrize("geometry", ["mesh", "heightmap", "polyline", "unheard_of"])
def test_unsupported_geometry_is_one_warning_and_the_rest_loads(load, geometry):
    odd = f'<collision name="odd"><geometry><{geometry}/></geometry></collision>'
    loaded = load(_model(f'{odd}<collision name="c">{BOX}</collision>'))
    assert len(loaded.world.shapes) == 1
    (warning,) = loaded.warnings
    assert "some.sdf" in warning
    assert "m/l/odd" in warning
    assert geometry in warning


def test_an_include_is_one_warning_that_names_its_uri(load):
    loaded = load("<include><uri>model://ship</uri></include>" + _model(f'<collision name="c">{BOX}</collision>'))
    (warning,) = loaded.warnings
    assert "model://ship" in warning


@pytest.mark.parametrize(
    "broken",
    [
        "<geometry><box><size>1 2</size></box></geometry>",
        "<geometry><box><size>1 2 x</size></box></geometry>",
        "<geometry><box><size>1 2 nan</size></box></geometry>",
        "<geometry><box><size>1 2 0</size></box></geometry>",
        "<geometry><cylinder><radius>1</radius></cylinder></geometry>",
        f"<pose>1 2 3</pose>{BOX}",
    ],
)
def test_a_broken_shape_is_one_warning_and_the_rest_loads(load, broken):
    loaded = load(_model(f'<collision name="bad">{broken}</collision><collision name="c">{BOX}</collision>'))
    assert [shape.name for shape in loaded.world.shapes] == ["m/l/c"]
    (warning,) = loaded.warnings
    assert "m/l/bad" in warning


def test_a_model_with_a_broken_pose_is_one_warning_and_the_rest_loads(load):
    shape = f'<collision name="c">{BOX}</collision>'
    loaded = load(_model(shape, "<pose>here</pose>") + _model(shape))
    assert len(loaded.world.shapes) == len(loaded.warnings) == 1


def test_a_pose_in_a_named_frame_is_a_warning(load):
    (warning,) = load(
        _model(f'<collision name="c"><pose relative_to="f">1 0 0 0 0 0</pose>{BOX}</collision>'), "1.7"
    ).warnings
    assert "m/l/c" in warning


def test_an_unknown_version_is_a_warning(load):
    (warning,) = load(_model(f'<collision name="c">{BOX}</collision>'), "1.11").warnings
    assert "1.11" in warning


def test_a_missing_file_is_refused_with_its_path(tmp_path):
    with pytest.raises(WorldError, match=r"none\.sdf.*No such file"):
        load_sdf(tmp_path / "none.sdf")


@pytest.mark.parametrize(("text", "reason"), [("<sdf>", "not XML"), ("<robot/>", "not an SDF file")])
def test_a_file_that_is_no_sdf_is_refused_with_its_path(tmp_path, text, reason):
    path = tmp_path / "odd.sdf"
    path.write_text(text)
    with pytest.raises(WorldError, match=rf"odd\.sdf.*{reason}"):
        load_sdf(path)


def test_a_world_without_shapes_is_refused_and_says_what_was_left_out(load):
    with pytest.raises(WorldError, match=r"some\.sdf.*no box.*<image>"):
        load(_model('<collision name="c"><geometry><image/></geometry></collision>'))


def test_the_basin_loads_without_warnings():
    loaded = load_sdf(BASIN)
    assert loaded.warnings == ()
    assert loaded.world.name == "basin"


def test_the_basin_is_120_by_50_by_5_5_m_inside():
    shapes = {shape.name: shape for shape in load_sdf(BASIN).world.shapes}
    assert shapes["basin/east_wall/box"].triangles()[0][:, 0].min() == 60.0
    assert shapes["basin/west_wall/box"].triangles()[0][:, 0].max() == -60.0
    assert shapes["basin/north_wall/box"].triangles()[0][:, 1].min() == 25.0
    assert shapes["basin/south_wall/box"].triangles()[0][:, 1].max() == -25.0
    assert shapes["basin/floor/box"].triangles()[0][:, 2].max() == -5.5
