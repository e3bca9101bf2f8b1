import re
import sys

import numpy as np
import pytest

from sonar_simulator.world.model_files import load_mesh
from sonar_simulator.world.world import MissingPackageError, WorldError
from sonar_simulator.world.world_file import load_world

trimesh = pytest.importorskip("trimesh")
DAE = """<?xml version="1.0"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
  <asset><created>2020-01-01T00:00:00</created><modified>2020-01-01T00:00:00</modified>{asset}</asset>
  <library_geometries><geometry id="g" name="g"><mesh>
    <source id="p"><float_array id="pa" count="9">0 0 0 100 0 0 0 200 0</float_array>
      <technique_common><accessor source="#pa" count="3" stride="3">
        <param name="X" type="float"/><param name="Y" type="float"/><param name="Z" type="float"/>
      </accessor></technique_common></source>
    <vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
    <triangles count="1"><input semantic="VERTEX" source="#v" offset="0"/><p>0 1 2</p></triangles>
  </mesh></geometry></library_geometries>
  <library_visual_scenes><visual_scene id="s"><node id="n"><translate>0 0 50</translate>
    <instance_geometry url="#g"/></node></visual_scene></library_visual_scenes>
  <scene><instance_visual_scene url="#s"/></scene>
</COLLADA>
"""


@pytest.fixture
def box():
    return trimesh.creation.box(extents=(1.0, 2.0, 3.0))


@pytest.mark.parametrize(
    ("suffix", "size", "height"),
    [("stl", (1, 2, 3), 0.0), ("obj", (1, 2, 3), 0.0), ("ply", (1, 2, 3), 0.0), ("glb", (1, 3, 2), 5.0)],
)
def test_a_mesh_without_unit_and_axis_is_metres_and_z_up_but_gltf_is_y_up(tmp_path, box, suffix, size, height):
    box.apply_translation((0.0, height, 0.0))
    box.export(str(tmp_path / f"box.{suffix}"))
    vertices, faces = load_mesh(tmp_path / f"box.{suffix}")
    assert len(faces) == 12
    np.testing.assert_allclose(np.ptp(vertices, axis=0), size, rtol=1e-6)
    np.testing.assert_allclose(vertices[:, 2].mean(), height, atol=1e-9)


@pytest.mark.parametrize(
    ("asset", "expected"),
    [
        ('<unit meter="0.01"/><up_axis>Z_UP</up_axis>', [(0, 0, 0.5), (1, 0, 0.5), (0, 2, 0.5)]),
        ('<unit meter="0.01"/><up_axis>Y_UP</up_axis>', [(0, -0.5, 0), (1, -0.5, 0), (0, -0.5, 2)]),
        ('<unit meter="0.01"/><up_axis>X_UP</up_axis>', [(0, -0.5, 0), (0, -0.5, 1), (-2, -0.5, 0)]),
        ("<up_axis>Z_UP</up_axis>", [(0, 0, 50), (100, 0, 50), (0, 200, 50)]),
    ],
)
def test_collada_says_its_unit_and_up_axis(tmp_path, asset, expected):
    path = tmp_path / "triangle.dae"
    path.write_text(DAE.format(asset=asset))
    vertices, faces = load_mesh(path)
    np.testing.assert_allclose(vertices[faces[0]], expected, atol=1e-9)


def test_every_instance_of_a_scene_is_there(tmp_path, box):
    scene = trimesh.Scene()
    for x in (0.0, 10.0):
        pose = np.eye(4)
        pose[0, 3] = x
        scene.add_geometry(box, geom_name="box", node_name=f"node{x}", transform=pose)
    path = tmp_path / "two.glb"
    scene.export(str(path))
    vertices, faces = load_mesh(path)
    assert len(faces) == 24
    assert np.ptp(vertices[:, 0]) == pytest.approx(11.0)


@pytest.mark.parametrize(
    ("name", "content", "reason"),
    [
        *((f"odd.{suffix}", content, "")
          for suffix in ("dae", "stl", "obj", "ply", "glb")
          for content in (b"", b"solid nonsense", b"\xff\xfe\x00nothing at all\x00" * 9)),
        ("gone.stl", None, ""),
        ("nan.obj", b"v 0 0 0\nv 1 0 nan\nv 0 1 0\nf 1 2 3\n", ": a vertex is not finite"),
    ],
)  # fmt: skip
def test_a_file_that_is_no_mesh_is_refused_with_its_path(tmp_path, name, content, reason):
    path = tmp_path / name
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(WorldError, match=re.escape(name) + reason):
        load_mesh(path)


@pytest.mark.parametrize(("suffix", "package"), [("stl", "trimesh"), ("dae", "trimesh"), ("dae", "collada")])
def test_without_the_reader_the_error_says_what_to_install(tmp_path, monkeypatch, suffix, package):
    monkeypatch.setitem(sys.modules, package, None)
    with pytest.raises(MissingPackageError, match=r"install it: \S+ -m pip install trimesh pycollada$"):
        load_mesh(tmp_path / f"box.{suffix}")


def test_a_bare_mesh_is_a_world(tmp_path, box):
    path = tmp_path / "wreck.stl"
    box.export(str(path))
    loaded = load_world(path)
    assert (loaded.name, loaded.warnings, len(loaded.faces)) == ("wreck", (), 12)
