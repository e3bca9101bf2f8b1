"""What an SDF world may hold beyond primitives: planes, meshes, included models, materials and colours."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from programs import ROOT

from sonar_simulator.world.world import MATERIALS
from sonar_simulator.world.world_file import load_world

WORLDS = ROOT / "worlds"
BOX = "<geometry><box><size>2 2 2</size></box></geometry>"
LINK = f'<link name="l"><collision name="c">{BOX}</collision></link>'


@pytest.fixture
def model_file(tmp_path, monkeypatch):
    """Write models/NAME/model.sdf on the model path."""
    monkeypatch.setenv("GAZEBO_MODEL_PATH", f"{tmp_path / 'nowhere'}:{tmp_path / 'path'}")

    def write(name, content, config=None, file_name="model.sdf"):
        folder = tmp_path / "path" / name
        folder.mkdir(parents=True, exist_ok=True)
        (folder / file_name).write_text(f'<sdf version="1.6">{content}</sdf>')
        if config:
            (folder / "model.config").write_text(f"<model>{config}</model>")
        return folder

    return write


def _link(content):
    return f'<model name="m"><link name="l">{content}</link></model>'


def _collision(geometry, extra=""):
    return _link(f'<collision name="c">{extra}{geometry}</collision>')


@given(st.tuples(*(st.floats(-1.0, 1.0) for _ in range(3))).filter(lambda normal: np.linalg.norm(normal) > 0.01))
def test_the_plane_of_a_collision_has_no_end_and_lies_across_its_normal(tmp_path_factory, normal):
    geometry = f"<geometry><plane><normal>{' '.join(map(repr, normal))}</normal><size>5 5</size></plane></geometry>"
    path = tmp_path_factory.getbasetemp() / "plane.sdf"
    path.write_text(f'<sdf version="1.6"><world name="w">{_collision(geometry)}</world></sdf>')
    (shape,) = load_world(path).shapes
    vertices, _ = shape.triangles()
    assert np.ptp(vertices, axis=0).max() > 2000.0
    np.testing.assert_allclose(vertices @ (normal / np.linalg.norm(normal)), 0.0, atol=1e-8)
    np.testing.assert_allclose(np.linalg.det(shape.pose[:3, :3]), 1.0)


def test_the_plane_of_a_visual_is_as_large_as_it_says(load):
    plane = "<geometry><plane><size>6 4</size></plane></geometry>"
    (shape,) = load(_link(f'<visual name="v">{plane}</visual>')).shapes
    assert np.ptp(shape.triangles()[0], axis=0).tolist() == [6.0, 4.0, 0.0]


def test_ground_plane_is_known_without_gazebo_and_the_sun_is_no_surface(load):
    uris = "".join(f"<include><uri>model://{name}</uri></include>" for name in ("ground_plane", "sun"))
    loaded = load(uris.replace("</uri></include><include>", "</uri><pose>0 0 -5 0 0 0</pose></include><include>"))
    assert loaded.warnings == ()
    (plane,) = loaded.shapes
    assert plane.kind == "plane"
    assert plane.pose[2, 3] == -5.0


def test_a_mesh_is_scaled_and_placed(load):
    mesh = "<geometry><mesh><uri>t.obj</uri><scale>2 3 4</scale></mesh></geometry>"
    (shape,) = load(_collision(mesh, "<pose>10 0 0 0 0 0</pose>")).shapes
    vertices, faces = shape.triangles()
    assert len(faces) == 4
    np.testing.assert_allclose(vertices.min(axis=0), (10, 0, 0))
    np.testing.assert_allclose(vertices.max(axis=0), (12, 3, 4))


@pytest.mark.parametrize(
    "uri", ["file://{folder}/t.obj", "{folder}/t.obj", "model://m/t.obj", "../path/m/t.obj", "package://boats/t.obj"]
)
def test_a_mesh_is_found_by_every_kind_of_uri(load, model_file, tmp_path, monkeypatch, uri):
    folder = model_file("m", "")
    (tmp_path / "t.obj").rename(folder / "t.obj")
    (folder / "package.xml").write_text(
        '<package format="2"><name>boats</name><version>1.0.0</version><description>d</description>'
        '<maintainer email="a@b.cd">m</maintainer><license>BSD</license></package>'
    )
    monkeypatch.setenv("ROS_PACKAGE_PATH", str(folder))
    world = load(_collision(f"<geometry><mesh><uri>{uri.format(folder=folder)}</uri></mesh></geometry>"))
    assert (world.warnings, len(world.faces)) == ((), 4)


def test_an_included_model_stands_where_the_include_says(load, model_file):
    model_file("post", f'<model name="post"><pose>7 7 7 0 0 0</pose>{LINK}</model>')
    loaded = load(
        "<include><uri>model://post</uri><name>first</name><pose>1 0 0 0 0 0</pose></include>"
        "<include><uri>model://post</uri></include>"
    )
    assert [shape.name for shape in loaded.shapes] == ["first/l/c", "model://post/l/c"]
    assert [shape.pose[0, 3] for shape in loaded.shapes] == [1.0, 7.0]


def test_an_include_takes_the_newest_version_up_to_1_7(load, model_file):
    config = '<sdf version="1.4">old.sdf</sdf><sdf version="1.7">new.sdf</sdf><sdf version="1.9">future.sdf</sdf>'
    model_file("m", f'<model name="m">{LINK}</model>', config, "new.sdf")
    assert len(load("<include><uri>model://m</uri></include>").shapes) == 1


def test_a_model_may_include_models(load, model_file):
    model_file("inner", f'<model name="i">{LINK}</model>')
    include = "<include><uri>model://inner</uri><pose>0 2 0 0 0 0</pose></include>"
    model_file("outer", f'<model name="o">{include}</model>')
    (shape,) = load("<include><uri>model://outer</uri><pose>1 0 0 0 0 0</pose></include>").shapes
    assert shape.pose[:3, 3].tolist() == [1.0, 2.0, 0.0]


def test_a_model_that_includes_itself_ends_in_one_warning(load, model_file):
    model_file("loop", '<model name="l"><include><uri>model://loop</uri></include></model>')
    (warning,) = load("<include><uri>model://loop</uri></include>" + _collision(BOX)).warnings
    assert "includes itself" in warning


def test_a_warning_in_an_included_file_names_that_file(load, model_file):
    folder = model_file("m", _collision("<geometry><image/></geometry>"))
    (warning,) = load("<include><uri>model://m</uri></include>" + _collision(BOX)).warnings
    assert warning.startswith(f"{folder / 'model.sdf'}: ")


def test_a_material_holds_for_what_is_inside(load):
    loaded = load(
        '<model name="m"><sonar:material>mud</sonar:material><link name="l">'
        f'<collision name="a">{BOX}</collision>'
        f'<collision name="b"><sonar:material>steel</sonar:material>{BOX}</collision></link></model>' + _collision(BOX)
    )
    assert [shape.material.name for shape in loaded.shapes] == ["mud", "steel", "concrete"]
    names = [loaded.materials[index].name for index in loaded.face_material[::12]]
    assert names == ["mud", "steel", "concrete"]


@pytest.mark.parametrize(
    ("element", "properties"),
    [
        (
            '<sonar:material reflection="0.3" slope="0.02" lambert_db="-30" mirror="0.9">tiles</sonar:material>',
            {"name": "tiles", "reflection": 0.3, "slope": 0.02, "lambert_db": -30.0, "mirror": 0.9},
        ),
        ("<laser_retro>0.25</laser_retro>", {"reflection": 0.25}),
        ("<laser_retro>0</laser_retro>", vars(MATERIALS["concrete"])),
    ],
)
def test_a_material_of_ones_own_has_properties_as_attributes_and_laser_retro_is_a_reflection(load, element, properties):
    (shape,) = load(_collision(BOX, element)).shapes
    assert {**vars(shape.material), **properties} == vars(shape.material)


@pytest.mark.parametrize(
    "material",
    [
        "<sonar:material>cheese</sonar:material>",
        '<sonar:material reflection="2">x</sonar:material>',
        "<laser_retro>x</laser_retro>",
    ],
)
def test_a_material_that_makes_no_sense_is_one_warning_and_the_shape_stays(load, material):
    loaded = load(_collision(BOX, material))
    assert len(loaded.shapes) == len(loaded.warnings) == 1
    assert "m/l/c" in loaded.warnings[0]


def test_the_colour_of_a_link_is_its_visuals(load):
    visual = f'<visual name="v">{BOX}<material><diffuse>1 0.5 0 0.8</diffuse></material></visual>'
    (shape,) = load(_link(f'{visual}<collision name="c">{BOX}</collision>')).shapes
    assert shape.colour == (1.0, 0.5, 0.0, 0.8)


@pytest.mark.parametrize(("name", "low", "high"), [("basin", 500, 20000), ("tank", 50, 100), ("harbour", 2300, 2700)])
def test_a_shipped_world_loads_without_warnings(name, low, high):
    loaded = load_world(WORLDS / f"{name}.sdf")
    assert loaded.warnings == ()
    assert low <= len(loaded.faces) <= high


def test_the_harbours_bed_rises_out_of_the_water_in_the_east():
    (bed,) = [shape for shape in load_world(WORLDS / "harbour.sdf").shapes if shape.kind == "mesh"]
    vertices, _ = bed.triangles()
    assert vertices[vertices[:, 0] < 5.0, 2].max() < -5.5
    assert vertices[vertices[:, 0] > 31.0, 2].min() > 0.0
    assert math.isclose(np.ptp(vertices[:, 0]), 64.0)
