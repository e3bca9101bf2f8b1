"""MLSM/octomap: what a subscriber with octomap_msgs gets. The message is built from its definition, as rosbag does."""

import re
import shutil
import subprocess
import sys
from importlib.machinery import ModuleSpec
from io import BytesIO
from types import ModuleType

import genpy.dynamic
import numpy as np
import pytest
from made_maps import random_map
from std_msgs.msg import Header

from mlsm_manager.ros.map_publisher import has_octomap_messages, octomap_message
from mlsm_manager.surface_map.export.octomap import block_voxels, octree

pyoctomap = pytest.importorskip("pyoctomap")

DEFINITION = f"""Header header
bool binary
string id
float64 resolution
int8[] data
{"=" * 80}
MSG: std_msgs/Header
{Header._full_text}
"""
MD5 = "9a45536b45c5e409cd49f04bb2d9999f"
"""Of octomap_msgs/Octomap, as its package has it."""
RESOLUTION = 0.5


@pytest.fixture
def message_type(monkeypatch):
    """Return the type octomap_msgs.msg.Octomap, which can be imported meanwhile."""
    kind = genpy.dynamic.generate_dynamic("octomap_msgs/Octomap", DEFINITION)["octomap_msgs/Octomap"]
    for name in ("octomap_msgs", "octomap_msgs.msg"):
        module = ModuleType(name)
        module.__spec__ = ModuleSpec(name, None)
        monkeypatch.setitem(sys.modules, name, module)
    sys.modules["octomap_msgs.msg"].Octomap = kind
    return kind


@pytest.fixture
def received(message_type):
    """Return the message as it arrives."""
    buffer = BytesIO()
    occupied, free = random_map(0).blocks, random_map(1).blocks
    octomap_message(octree(occupied, free), Header(frame_id="map")).serialize(buffer)
    return message_type().deserialize(buffer.getvalue())


def file_of(message):
    """Return the .bt file that the message stands for: octomap_msgs leaves out the header.

    Its number of nodes is the root and each child that is not 00, two bits per child.
    """
    data = np.array(message.data, dtype=np.int8).view(np.uint8)
    nodes = 1 + int(np.count_nonzero((data[:, np.newaxis] >> np.array([0, 2, 4, 6])) & 3))
    header = f"# Octomap OcTree binary file\nid {message.id}\nsize {nodes}\nres {message.resolution}\ndata\n"
    return header.encode() + data.tobytes()


def voxels(blocks):
    return {tuple(voxel) for voxel in block_voxels(blocks)[0].tolist()}


def cells_of_leaf(center, size):
    side, low = round(size / RESOLUTION), np.array(center) - size / 2.0
    first = np.rint(low / RESOLUTION).astype(int)
    return {tuple(first + step) for step in np.ndindex(side, side, side)}


def test_the_type_is_that_of_octomap_msgs(message_type):
    assert message_type._md5sum == MD5
    assert has_octomap_messages()


def test_octomap_reads_the_same_cells_free_and_occupied(tmp_path, received):
    (tmp_path / "map.bt").write_bytes(file_of(received))
    tree = pyoctomap.OcTree(0.1)
    assert tree.readBinary(str(tmp_path / "map.bt"))
    leaves = {True: set(), False: set()}
    for leaf in tree.begin_leafs():
        leaves[tree.isNodeOccupied(leaf)] |= cells_of_leaf(leaf.getCoordinate(), leaf.getSize())
    occupied, free = voxels(random_map(0).blocks), voxels(random_map(1).blocks)
    assert leaves == {True: occupied, False: free - occupied}
    assert (received.binary, received.header.frame_id, received.resolution) == (True, "map", RESOLUTION)


@pytest.mark.skipif(shutil.which("bt2vrml") is None, reason="needs apt's octomap-tools")
def test_the_packaged_library_reads_the_same_occupied_cells(tmp_path, received):
    (tmp_path / "map.bt").write_bytes(file_of(received))
    subprocess.run(["bt2vrml", "map.bt"], cwd=str(tmp_path), check=True, stdout=subprocess.DEVNULL)
    boxes = re.findall(r"translation (\S+) (\S+) (\S+).*?size (\S+)", (tmp_path / "map.bt.wrl").read_text(), re.S)
    cells = set().union(*(cells_of_leaf(list(map(float, box[:3])), float(box[3])) for box in boxes))
    assert cells == voxels(random_map(0).blocks)
