"""Maps as files: what is kept exactly, what is rounded, what no file may hold, and the folder of a user's maps."""

import os
import stat
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from made_maps import content, in_order, map_with, partition, random_map, stored_map

from mlsm_manager.surface_map.array_file import ArrayFileError, decoded, encoded
from mlsm_manager.surface_map.blocks import Blocks
from mlsm_manager.surface_map.export.formats import write_ply
from mlsm_manager.surface_map.export.map_folder import MapFolder
from mlsm_manager.surface_map.map_file import (
    Layer,
    MapFileError,
    StoredMap,
    map_bytes,
    map_of_bytes,
    read_map,
    write_map,
)
from mlsm_manager.surface_map.mlsm import MultiLevelSurfaceMap
from mlsm_manager.surface_map.operations import LevelTransform, cropped, merged
from node_support.marks import Mark

MUTATIONS = 1000


def _loaded(blocks):
    return map_of_bytes(map_bytes(StoredMap("map", {Layer.SHOWN: blocks}))).shown


@given(st.integers(0, 2**31), st.integers(0, 400), st.sampled_from([0.1, 0.5, 3.0]))
def test_cell_bottom_top_number_of_points_and_crossings_are_kept_exactly(seed, count, resolution):
    blocks = random_map(seed, count, resolution, extent=3.0).blocks
    crossed = np.arange(len(blocks), dtype=np.uint16)
    loaded = _loaded(replace(blocks, crossed=crossed))
    assert partition(loaded) == partition(blocks)
    assert loaded.crossed.tolist() == crossed[in_order(blocks)].tolist()


def test_means_and_deviations_are_kept_to_a_part_of_a_cell():
    blocks = random_map(count=20000, extent=4.0).blocks
    loaded, blocks = _loaded(blocks), blocks.take(in_order(blocks))
    np.testing.assert_allclose(loaded.mean[:, :2], blocks.mean[:, :2], rtol=0, atol=0.5 / 2**16)
    depth = np.maximum(blocks.depth, 1e-12)
    assert np.abs((loaded.mean[:, 2] - blocks.mean[:, 2]) / depth).max() < 2.0**-16
    np.testing.assert_allclose(loaded.mean[:, 3], blocks.mean[:, 3], rtol=2**-23)
    deviations = np.sqrt(loaded.variance) - np.sqrt(blocks.variance)
    assert np.abs(deviations[:, :2]).max() < 0.25 / 2**16
    assert np.abs(deviations[:, 2] / depth).max() < 2.0**-17
    np.testing.assert_allclose(np.sqrt(loaded.variance[:, 3]), np.sqrt(blocks.variance[:, 3]), rtol=2**-22)


def test_marks_are_kept_and_files_without_any_can_be_read():
    marks = [Mark("mooring block ⚓", 1.5, -2.25, -3.0), Mark("b", 0.0, 0.0)]
    assert map_of_bytes(map_bytes(replace(stored_map(), marks=marks))).marks == marks
    words, arrays = decoded(map_bytes(stored_map()))
    del words["marks"]
    assert map_of_bytes(encoded(words, arrays)).marks == []


def test_a_map_with_a_mark_that_is_none_is_refused():
    words, arrays = decoded(map_bytes(stored_map()))
    with pytest.raises(ArrayFileError, match="printable"):
        map_of_bytes(encoded({**words, "marks": [["", 0.0, 0.0, 0.0]]}, arrays))


def test_marks_go_with_their_map_when_maps_are_merged_and_cropped():
    first = replace(stored_map(), marks=[Mark("a", 1.0, 1.0)])
    second = replace(stored_map(), marks=[Mark("a", 5.0, 5.0), Mark("b", 1.0, 0.0, -1.0)])
    both = merged(first, second, LevelTransform(x=10.0, yaw=np.pi / 2.0))
    assert {mark.name: mark for mark in both.marks} == {"a": Mark("a", 1.0, 1.0), "b": Mark("b", 10.0, 1.0, -1.0)}
    assert cropped(both, np.array([0.0, 0.0]), np.array([2.0, 2.0])).marks == [Mark("a", 1.0, 1.0)]


def test_what_was_loaded_is_saved_as_it_was():
    once = map_of_bytes(map_bytes(stored_map()))
    assert content(map_of_bytes(map_bytes(once))) == content(once)


def test_a_file_holds_layers_frame_calibration_time_and_arrays(tmp_path):
    stored = stored_map()
    write_map(tmp_path / "basin.mlsm", stored)
    read = read_map(tmp_path / "basin.mlsm")
    assert set(read.layers) == {Layer.SHOWN, Layer.FREE}
    assert (read.frame, read.made, read.calibration) == (stored.frame, stored.made, stored.calibration)
    assert read.shown.resolution == 0.5
    assert read.arrays["place"].tolist() == [1.0, 2.0, 0.3]


def test_cells_at_the_ends_of_the_grid_are_kept():
    blocks = map_with([[x, y, 0.0, 1.0] for x in (-1e6, 1e6) for y in (-1e6, 1e6)], 0.01, limit=1e6).blocks
    assert partition(_loaded(blocks)) == partition(blocks)


@pytest.mark.parametrize("extent", [2.0, 30.0])
def test_a_block_takes_at_most_40_bytes_however_many_points_it_holds(extent):
    blocks = random_map(count=60000, extent=extent).blocks
    assert len(map_bytes(StoredMap("map", {Layer.SHOWN: blocks}))) < 40 * len(blocks) + 4000


@pytest.fixture(scope="module")
def file_bytes():
    return map_bytes(stored_map(count=300))


def test_no_mutated_file_is_taken_for_another_map(file_bytes):
    right, rng = content(map_of_bytes(file_bytes)), np.random.RandomState(1)
    read = [_read_or_refused(_mutated(file_bytes, rng)) for _ in range(MUTATIONS)]
    assert {type(stored) for stored in read} <= {ArrayFileError, StoredMap}
    assert all(content(stored) == right for stored in read if isinstance(stored, StoredMap))
    assert sum(isinstance(stored, ArrayFileError) for stored in read) > 0.99 * MUTATIONS


def test_columns_that_no_map_has_are_refused_even_with_a_right_checksum(file_bytes):
    words, arrays = decoded(file_bytes)
    rng = np.random.RandomState(2)
    names = [name for name in arrays if name.startswith("shown/")]
    for _ in range(300):
        changed = dict(arrays)
        name = names[rng.randint(len(names))]
        kind = rng.choice(["<f8", "<i4", "<u2"])
        with np.errstate(invalid="ignore"):
            changed[name] = rng.choice([np.nan, -1.0, 0.0, 1e9], arrays[name].shape).astype(kind)[: rng.randint(9)]
        if rng.randint(2):
            del changed[names[rng.randint(len(names))]]
        with pytest.raises(ArrayFileError, match=r"^.*$"):
            map_of_bytes(encoded(words, changed))


def _read_or_refused(data):
    """Return the map, or the error that says why the bytes are none."""
    try:
        return map_of_bytes(data)
    except ArrayFileError as error:
        return error


def _mutated(data, rng):
    """Return the bytes with one of the things done to them that disks, transfers and people do to files."""
    place, other, length = rng.randint(len(data)), rng.randint(len(data)), rng.randint(1, 600)
    before, part, after = data[:place], data[place : place + length], data[place + length :]
    return [
        before + bytes([part[0] ^ 1 << rng.randint(8)]) + part[1:] + after,
        before,
        before + after,
        before + rng.bytes(length) + part + after,
        before + bytes(len(part)) + after,
        before + data[other : other + len(part)] + after,
    ][rng.randint(6)]


@pytest.mark.parametrize(
    ("data", "reason"),
    [
        (b"", "not a map of this package"),
        (b"ply\nformat ascii 1.0\n", "not a map of this package"),
        (b"MLSM\r\n\x1a\n", "cut short"),
    ],
)
def test_other_files_are_refused_in_one_line_with_their_path(tmp_path, data, reason):
    path = tmp_path / "basin.mlsm"
    path.write_bytes(data)
    with pytest.raises(MapFileError, match=f"{path}: {reason}"):
        read_map(path)


def test_a_file_of_a_later_version_is_refused(file_bytes):
    with pytest.raises(ArrayFileError, match="version 2, must be 1"):
        map_of_bytes(file_bytes[:8] + b"\x02\x00" + file_bytes[10:])


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
    axes = ["x", "y", "z", "intensity"]
    names = [*axes, *(f"variance_{axis}" for axis in axes), "bottom", "height", "count", "type"]
    held = np.column_stack([blocks.mean, blocks.variance, blocks.bottom, blocks.height, blocks.count, blocks.type])
    np.testing.assert_array_equal(np.column_stack([vertices[name] for name in names]), held)


def test_an_empty_map_is_a_file_without_vertices(tmp_path):
    write_ply(tmp_path / "empty.ply", MultiLevelSurfaceMap(0.5).blocks)
    assert len(_read_ply(tmp_path / "empty.ply")[1]) == 0


def test_others_may_read_the_map(tmp_path, blocks):
    write_ply(tmp_path / "basin.ply", blocks)
    assert stat.S_IMODE((tmp_path / "basin.ply").stat().st_mode) == 0o644


@pytest.fixture
def folder(tmp_path):
    return MapFolder(str(tmp_path / "maps"))


def _files(folder):
    return sorted(path.name for path in folder.folder.iterdir())


def test_a_map_of_the_same_name_is_kept_under_a_numbered_one(folder):
    for seed in range(3):
        folder.save("basin", stored_map(seed))
    assert _files(folder) == ["basin.1.mlsm", "basin.2.mlsm", "basin.mlsm"]
    first, newest = stored_map(0).layers[Layer.SHOWN], stored_map(2).layers[Layer.SHOWN]
    assert len(folder.load("basin.1").shown) == len(first)
    assert len(folder.load("basin").shown) == len(folder.load("basin.mlsm").shown) == len(newest)


def test_overwriting_keeps_nothing(folder):
    for seed in range(2):
        folder.save("basin", stored_map(seed), overwrite=True)
    assert _files(folder) == ["basin.mlsm"]


@pytest.mark.parametrize("overwrite", [False, True])
def test_an_empty_map_replaces_none(folder, overwrite):
    folder.save("basin", stored_map())
    before = (folder.folder / "basin.mlsm").read_bytes()
    empty = StoredMap("map", {Layer.SHOWN: Blocks.none(0.5), Layer.FREE: stored_map().shown})
    with pytest.raises(MapFileError, match="not replaced, the map has no blocks"):
        folder.save("basin", empty, overwrite)
    assert _files(folder) == ["basin.mlsm"]
    assert (folder.folder / "basin.mlsm").read_bytes() == before


@pytest.mark.parametrize("call", ["fsync", "replace"])
def test_a_disk_that_fails_leaves_the_old_map(folder, monkeypatch, call):
    folder.save("basin", stored_map(), overwrite=True)

    def full_disk(*_):
        raise OSError("no space left on device")

    monkeypatch.setattr(os, call, full_disk)
    with pytest.raises(OSError, match="no space left"):
        folder.save("basin", stored_map(1), overwrite=True)
    monkeypatch.undo()
    assert content(folder.load("basin"))[0].keys() == content(stored_map())[0].keys()
    assert (folder.folder / "basin.mlsm").read_bytes() == map_bytes(stored_map())
    assert _files(folder) == ["basin.mlsm"]


@pytest.mark.parametrize(
    "name", ["", ".", "..", "../basin", "a/b", "/etc/passwd", "a/..", "basin/", ".hidden", "a\0b", "~/../x"]
)
def test_a_name_that_would_leave_the_folder_is_refused(folder, name):
    with pytest.raises(MapFileError, match="must be a plain file name"):
        folder.path(name)


def test_a_name_that_no_file_system_takes_is_refused_in_one_line(folder):
    with pytest.raises(MapFileError, match=r"^name 'ö{20}'\.\.\.: has 150 letters, must be 200 bytes at most$"):
        folder.load("ö" * 150)


def test_a_link_that_leads_out_of_the_folder_is_refused(folder, tmp_path):
    folder.folder.mkdir()
    (tmp_path / "outside.mlsm").write_bytes(b"")
    (folder.folder / "basin.mlsm").symlink_to(tmp_path / "outside.mlsm")
    with pytest.raises(MapFileError, match="which is not in"):
        folder.load("basin")


def test_a_map_that_is_not_there_is_told_in_one_line_with_its_path(folder):
    with pytest.raises(MapFileError, match=r"basin\.mlsm: No such file"):
        folder.load("basin")


def test_a_map_put_aside_has_another_name_and_only_one_is_kept(folder):
    for seed in range(2):
        folder.save("core.autosave", stored_map(seed), overwrite=True)
        folder.put_aside("core.autosave")
    assert _files(folder) == ["core.autosave.previous.mlsm"]
    assert len(folder.load("core.autosave.previous")) == len(stored_map(1))


def test_a_map_that_another_node_has_put_aside_need_not_be_put_aside(folder):
    folder.put_aside("core.autosave")
    assert not folder.folder.exists()


def test_an_ending_tells_the_format_and_is_numbered_too(folder):
    for _ in range(2):
        folder.save("basin.ply", stored_map())
    assert _files(folder) == ["basin.1.ply", "basin.ply"]
    assert (folder.folder / "basin.ply").read_bytes().startswith(b"ply")
