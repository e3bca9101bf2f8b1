"""Maps in other programs' formats, read back by those programs' own readers."""

import re
import shutil
import subprocess

import numpy as np
import pytest
import yaml
from made_maps import map_with, random_map
from PIL import Image

from mlsm_manager.surface_map.export.formats import (
    ExportOptions,
    block_voxels,
    export,
    octree,
    write_octree,
    write_pcd,
    write_ply,
)
from mlsm_manager.surface_map.export.pictures import ColorBy, block_colors, box_mesh
from mlsm_manager.surface_map.export.rasters import (
    FREE,
    OCCUPIED,
    UNKNOWN,
    elevation,
    occupancy,
    write_ascii_grid,
    write_map_server,
)
from mlsm_manager.surface_map.map_file import ExportError, Layer, StoredMap

RESOLUTION = 0.5


def _blocks(*places):
    return map_with([[*place, 50.0] for place in places], RESOLUTION).blocks


@pytest.fixture(scope="module")
def occupied():
    return random_map(0).blocks


@pytest.fixture(scope="module")
def free():
    return random_map(1).blocks


def voxels(blocks):
    """Return the set of voxels that blocks fill."""
    return {tuple(voxel) for voxel in block_voxels(blocks)[0].tolist()}


def cells_of_tree(tree):
    """Return the voxels of a pyoctomap tree: {True: those occupied, False: those free}."""
    leaves = {True: set(), False: set()}
    for leaf in tree.begin_leafs():
        leaves[tree.isNodeOccupied(leaf)] |= _cells_of_leaf(leaf.getCoordinate(), leaf.getSize())
    return leaves


def cells_of_vrml(folder):
    """Return the occupied voxels of map.bt in a folder as apt's octomap-tools see them."""
    subprocess.run(["bt2vrml", "map.bt"], cwd=str(folder), check=True, stdout=subprocess.DEVNULL)
    boxes = re.findall(r"translation (\S+) (\S+) (\S+).*?size (\S+)", (folder / "map.bt.wrl").read_text(), re.S)
    return set().union(*(_cells_of_leaf(list(map(float, box[:3])), float(box[3])) for box in boxes))


def _cells_of_leaf(center, size):
    """Return all cells that a leaf covers; pruned leaves cover 8, 64 and so on."""
    side = round(size / RESOLUTION)
    first = np.rint((np.array(center) - size / 2.0) / RESOLUTION).astype(int)
    return {tuple(first + step) for step in np.ndindex(side, side, side)}


def test_octomap_reads_the_same_cells_free_and_occupied(tmp_path, occupied, free):
    pyoctomap = pytest.importorskip("pyoctomap")
    for ending in (".bt", ".ot"):
        path = tmp_path / f"map{ending}"
        write_octree(path, occupied, free)
        if ending == ".bt":
            tree = pyoctomap.OcTree(0.1)
            assert tree.readBinary(str(path))
        else:
            tree = pyoctomap.OcTree(0.1).read(str(path))
        assert tree.getResolution() == RESOLUTION
        assert cells_of_tree(tree) == {True: voxels(occupied), False: voxels(free) - voxels(occupied)}


@pytest.mark.skipif(shutil.which("bt2vrml") is None, reason="needs apt's octomap-tools")
def test_the_packaged_octomap_reads_the_same_occupied_cells(tmp_path, occupied, free):
    pytest.importorskip("pyoctomap")
    write_octree(tmp_path / "map.bt", occupied, free)
    assert cells_of_vrml(tmp_path) == voxels(occupied)


def test_the_more_points_the_surer_a_cell_of_the_tree():
    pytest.importorskip("pyoctomap")
    tree = octree(_blocks((0.1, 0.1, 0.1), *[(5.1, 0.1, 0.1)] * 3), _blocks((9.1, 0.1, 0.1)))
    log_odds = [tree.search([x, 0.25, 0.25]).getLogOdds() for x in (0.25, 5.25, 9.25)]
    np.testing.assert_allclose(log_odds, [0.85, 2.55, -0.4], rtol=1e-5)


def test_a_map_wider_than_a_tree_is_refused():
    blocks = map_with([20000.0, 0.0, 0.0, 1.0], RESOLUTION, limit=1e6).blocks
    with pytest.raises(ExportError, match="reaches beyond 16384 m"):
        block_voxels(blocks)


# Open3D does not read unsigned numbers from a PLY.
@pytest.mark.parametrize(
    ("write", "file", "unread"), [(write_pcd, "map.pcd", set()), (write_ply, "map.ply", {"count"})]
)
def test_open3d_reads_what_a_pcd_or_a_ply_holds(tmp_path, occupied, write, file, unread):
    open3d = pytest.importorskip("open3d")
    write(tmp_path / file, occupied)
    cloud = open3d.t.io.read_point_cloud(str(tmp_path / file))
    np.testing.assert_allclose(cloud.point["positions"].numpy(), occupied.mean[:, :3], rtol=1e-6, atol=1e-6)
    expected = {"intensity": occupied.mean[:, 3], "type": occupied.type, "height": occupied.height}
    expected.update(variance_x=occupied.variance[:, 0], variance_intensity=occupied.variance[:, 3])
    expected.update(bottom=occupied.bottom, count=occupied.count)
    for name in set(expected) - unread:
        np.testing.assert_allclose(cloud.point[name].numpy()[:, 0], expected[name], rtol=1e-6, atol=1e-6)


def test_a_grid_tells_free_unknown_and_occupied_apart():
    grid = occupancy(_blocks((0.1, 0.1, 0.0), (2.1, 0.1, 5.0)), _blocks((0.6, 0.1, 0.0), (0.1, 0.1, 0.0)), -1.0, 1.0)
    assert grid.values.tolist() == [[OCCUPIED, FREE]]
    grid = occupancy(_blocks((0.1, 0.1, 0.0), (1.1, 0.6, 0.0)), _blocks((0.6, 0.1, 0.0)), -1.0, 1.0)
    assert grid.values.tolist() == [[OCCUPIED, FREE, UNKNOWN], [UNKNOWN, UNKNOWN, OCCUPIED]]
    assert grid.origin.tolist() == [0.0, 0.0]


def test_map_servers_file_has_the_first_row_at_the_top(tmp_path):
    grid = occupancy(_blocks((-0.4, 0.1, 0.0), (0.6, 0.6, 0.0)), _blocks((0.1, 0.1, 0.0)), -1.0, 1.0)
    write_map_server(tmp_path / "map.pgm", grid)
    words = yaml.safe_load((tmp_path / "map.yaml").read_text())
    assert np.asarray(Image.open(str(tmp_path / "map.pgm"))).tolist() == [[205, 205, 0], [0, 254, 205]]
    assert (words["image"], words["resolution"], words["origin"]) == ("map.pgm", 0.5, [-0.5, 0.0, 0.0])


def test_map_servers_thresholds_tell_the_three_shades_apart(tmp_path):
    write_map_server(tmp_path / "map.pgm", occupancy(_blocks((0.1, 0.1, 0.0)), _blocks(), -1.0, 1.0))
    words = yaml.safe_load((tmp_path / "map.yaml").read_text())
    probability = {shade: (255 - shade) / 255.0 for shade in (0, 205, 254)}
    assert probability[0] > words["occupied_thresh"]
    assert probability[254] < words["free_thresh"] < probability[205] < words["occupied_thresh"]


def test_an_elevation_is_the_highest_point_of_a_cell():
    raster = elevation(_blocks((0.1, 0.1, -5.0), (0.1, 0.1, -2.0), (1.1, 0.6, -3.0)))
    np.testing.assert_array_equal(raster.values, [[-2.0, np.nan, np.nan], [np.nan, np.nan, -3.0]])


def test_an_ascii_grid_begins_in_the_upper_left(tmp_path):
    write_ascii_grid(tmp_path / "map.asc", elevation(_blocks((-0.4, 0.1, -2.0), (0.1, 0.6, -3.0))))
    lines = (tmp_path / "map.asc").read_text().splitlines()
    assert lines[:6] == ["ncols 2", "nrows 2", "xllcorner -0.5", "yllcorner 0", "cellsize 0.5", "NODATA_value -9999"]
    assert [list(map(float, line.split())) for line in lines[6:]] == [[-9999.0, -3.0], [-2.0, -9999.0]]


def test_a_raster_that_would_not_fit_into_memory_is_refused():
    blocks = map_with([[-9e5, -9e5, 0, 1], [9e5, 9e5, 0, 1]], resolution=0.01, limit=1e6).blocks
    with pytest.raises(ExportError, match="crop the map first"):
        elevation(blocks)


@pytest.mark.parametrize("by", list(ColorBy))
def test_colours_are_from_0_to_1(occupied, by):
    colors = block_colors(occupied, by)
    assert colors.shape == (len(occupied), 3)
    assert ((colors >= 0.0) & (colors <= 1.0)).all()


def test_higher_blocks_have_other_colours():
    low, high = block_colors(_blocks((0.1, 0.1, -5.0), (1.1, 0.1, 0.0)), ColorBy.HEIGHT)
    assert np.abs(low - high).max() > 0.3


def test_a_box_is_as_large_as_its_block():
    corners, triangles = box_mesh(_blocks((0.1, 0.1, -2.0), (0.1, 0.1, -1.7)))
    assert (corners.min(axis=0).tolist(), corners.max(axis=0).tolist()) == ([0.0, 0.0, -2.0], [0.5, 0.5, -1.7])
    assert triangles.max() == 7
    assert len(triangles) == 12


@pytest.mark.parametrize(
    ("ending", "beginning", "module"),
    [
        (".ply", b"ply", None), (".pcd", b"#", "open3d"), (".bt", b"#", "pyoctomap"), (".ot", b"#", "pyoctomap"),
        (".pgm", b"P5", None), (".tif", b"II*\0", "rasterio"), (".asc", b"ncols", None), (".png", b"\x89PNG", None),
        (".mlsm", b"MLSM", None),
    ],
)  # fmt: skip
def test_the_ending_tells_the_format(tmp_path, occupied, free, ending, beginning, module):
    if module:
        pytest.importorskip(module)
    path = tmp_path / f"map{ending}"
    export(StoredMap("map", {Layer.SHOWN: occupied, Layer.FREE: free}), path, ExportOptions())
    assert path.read_bytes().startswith(beginning)
    assert not [name for name in tmp_path.iterdir() if name.name.startswith(".")]


def test_an_empty_map_is_not_exported(tmp_path):
    with pytest.raises(ExportError, match="no blocks"):
        export(StoredMap("map", {Layer.SHOWN: _blocks()}), tmp_path / "map.ply", ExportOptions())
