"""MLSM/octomap: what a subscriber with octomap_msgs gets. The message is built from its definition, as rosbag does."""

import shutil
import sys
from importlib.machinery import ModuleSpec
from io import BytesIO
from types import ModuleType

import genpy.dynamic
import numpy as np
import pytest
from made_maps import random_map
from octomap_reading import RESOLUTION, cells_of_tree, cells_of_vrml, voxels
from std_msgs.msg import Header

from mlsm_manager.ros.map_publisher import has_octomap_messages, octomap_message
from mlsm_manager.surface_map.export.octomap import octree

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


def test_the_type_is_that_of_octomap_msgs(message_type):
    assert message_type._md5sum == MD5
    assert has_octomap_messages()


def test_octomap_reads_the_same_cells_free_and_occupied(tmp_path, received):
    (tmp_path / "map.bt").write_bytes(file_of(received))
    tree = pyoctomap.OcTree(0.1)
    assert tree.readBinary(str(tmp_path / "map.bt"))
    occupied, free = voxels(random_map(0).blocks), voxels(random_map(1).blocks)
    assert cells_of_tree(tree) == {True: occupied, False: free - occupied}
    assert (received.binary, received.header.frame_id, received.resolution) == (True, "map", RESOLUTION)


@pytest.mark.skipif(shutil.which("bt2vrml") is None, reason="needs apt's octomap-tools")
def test_the_packaged_library_reads_the_same_occupied_cells(tmp_path, received):
    (tmp_path / "map.bt").write_bytes(file_of(received))
    assert cells_of_vrml(tmp_path) == voxels(random_map(0).blocks)
