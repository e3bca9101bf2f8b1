"""Maps as PLY files."""

import re
import stat

import numpy as np
import pytest
from made_maps import random_map

from mlsm_manager.surface_map.mlsm import MultiLevelSurfaceMap
from mlsm_manager.surface_map.ply_file import read_ply, write_ply

_NUMPY_TYPES = {"double": "<f8", "uint": "<u4", "uchar": "u1"}


@pytest.fixture
def blocks():
    return random_map(count=500, extent=3.0).blocks


def _read_ply(path):
    """Return a PLY's header lines and its vertices, read by the header alone."""
    header, data = path.read_bytes().split(b"end_header\n", 1)
    lines = header.decode("ascii").splitlines()
    properties = [line.split()[1:] for line in lines if line.startswith("property")]
    vertices = np.frombuffer(data, dtype=[(name, _NUMPY_TYPES[kind]) for kind, name in properties])
    return lines, vertices


def test_every_block_is_a_vertex_with_all_it_holds(tmp_path, blocks):
    write_ply(tmp_path / "basin.ply", blocks)
    lines, vertices = _read_ply(tmp_path / "basin.ply")
    assert lines[:2] == ["ply", "format binary_little_endian 1.0"]
    assert f"element vertex {len(blocks)}" in lines
    assert "comment multi level surface map, resolution 0.5 m" in lines
    np.testing.assert_array_equal(np.column_stack([vertices[n] for n in ("x", "y", "z", "intensity")]), blocks.mean)
    variances = [vertices[f"variance_{name}"] for name in ("x", "y", "z", "intensity")]
    np.testing.assert_array_equal(np.column_stack(variances), blocks.variance)
    np.testing.assert_array_equal(vertices["bottom"], blocks.bottom)
    np.testing.assert_array_equal(vertices["height"], blocks.height)
    np.testing.assert_array_equal(vertices["count"], blocks.count)
    np.testing.assert_array_equal(vertices["type"], blocks.type)


def test_an_empty_map_is_a_file_without_vertices(tmp_path):
    write_ply(tmp_path / "empty.ply", MultiLevelSurfaceMap(0.5).blocks)
    assert len(_read_ply(tmp_path / "empty.ply")[1]) == 0


def test_others_may_read_the_map(tmp_path, blocks):
    write_ply(tmp_path / "basin.ply", blocks)
    assert stat.S_IMODE((tmp_path / "basin.ply").stat().st_mode) == 0o644


def test_a_map_comes_back_as_it_was_saved(tmp_path, blocks):
    write_ply(tmp_path / "basin.ply", blocks)
    read = read_ply(tmp_path / "basin.ply")
    np.testing.assert_allclose(read.rows, blocks.rows, rtol=1e-12, atol=1e-12)
    assert read.resolution == blocks.resolution


@pytest.mark.parametrize("resolution", ["nan", "inf", "0", "-1", "half"])
def test_a_resolution_that_no_map_has_is_refused(tmp_path, blocks, resolution):
    path = tmp_path / "basin.ply"
    write_ply(path, blocks)
    path.write_bytes(path.read_bytes().replace(b"resolution 0.5 m", f"resolution {resolution} m".encode()))
    with pytest.raises(ValueError, match=re.escape(f"{path}: resolution {resolution} m")):
        read_ply(path)


@pytest.mark.parametrize(
    ("name", "value", "fault"),
    [
        ("x", np.nan, "not finite"),
        ("intensity", np.inf, "not finite"),
        ("variance_y", -0.1, "negative variance"),
        ("count", 0, "no points"),
        ("z", 100.0, "not between bottom and top"),
        ("type", 7, "unknown type"),
    ],
)
def test_a_block_that_no_map_holds_is_refused(tmp_path, blocks, name, value, fault):
    path = tmp_path / "basin.ply"
    write_ply(path, blocks)
    vertices = _read_ply(path)[1].copy()
    vertices[name][3] = value
    header = path.read_bytes().split(b"end_header\n", 1)[0]
    path.write_bytes(header + b"end_header\n" + vertices.tobytes())
    with pytest.raises(ValueError, match=f"1 of {len(blocks)} blocks have .*{fault}"):
        read_ply(path)


@pytest.mark.parametrize("change", [lambda data: data[:-1], lambda data: data + b"x", lambda data: data[5:]])
def test_a_file_of_another_size_is_refused(tmp_path, blocks, change):
    path = tmp_path / "basin.ply"
    write_ply(path, blocks)
    path.write_bytes(change(path.read_bytes()))
    with pytest.raises(ValueError, match=r"basin\.ply"):
        read_ply(path)
