"""The folder of maps: names, what is kept of what was there, what is refused."""

import os

import numpy as np
import pytest
from made_maps import content, stored_map

from mlsm_manager.surface_map.blocks import ROW_WIDTH, Blocks
from mlsm_manager.surface_map.export.map_folder import MapFolder
from mlsm_manager.surface_map.map_file import Layer, MapFileError, StoredMap, map_bytes


@pytest.fixture
def folder(tmp_path):
    return MapFolder(str(tmp_path / "maps"))


def _files(folder):
    return sorted(path.name for path in folder.folder.iterdir())


def test_a_map_is_loaded_by_the_name_it_was_saved_under(folder):
    folder.save("basin", stored_map())
    assert len(folder.load("basin")) == len(folder.load("basin.mlsm")) == len(stored_map())


def test_a_map_of_the_same_name_is_kept_under_a_numbered_one(folder):
    for seed in range(3):
        folder.save("basin", stored_map(seed))
    assert _files(folder) == ["basin.1.mlsm", "basin.2.mlsm", "basin.mlsm"]
    first, newest = stored_map(0).layers[Layer.SHOWN], stored_map(2).layers[Layer.SHOWN]
    assert len(folder.load("basin.1").shown) == len(first)
    assert len(folder.load("basin").shown) == len(newest)


def test_overwriting_keeps_nothing(folder):
    for seed in range(2):
        folder.save("basin", stored_map(seed), overwrite=True)
    assert _files(folder) == ["basin.mlsm"]


@pytest.mark.parametrize("overwrite", [False, True])
def test_an_empty_map_replaces_none(folder, overwrite):
    folder.save("basin", stored_map())
    before = (folder.folder / "basin.mlsm").read_bytes()
    empty = StoredMap("map", {Layer.SHOWN: Blocks(np.empty((0, ROW_WIDTH)), 0.5), Layer.FREE: stored_map().shown})
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
