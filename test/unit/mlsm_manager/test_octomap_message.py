"""MLSM/octomap: what a subscriber with octomap_msgs gets. The message is built from its definition, as rosbag does."""

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
from mlsm_manager.surface_map.export.octomap import octree, write_octree

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


def test_the_type_is_that_of_octomap_msgs(message_type):
    assert message_type._md5sum == MD5
    assert has_octomap_messages()


def test_the_message_holds_the_tree_of_a_file(tmp_path, received):
    """octomap_msgs leaves out the header."""
    write_octree(tmp_path / "map.bt", random_map(0).blocks, random_map(1).blocks)
    header, tree = (tmp_path / "map.bt").read_bytes().split(b"\ndata\n", 1)
    assert np.array(received.data, dtype=np.int8).tobytes() == tree
    assert f"id {received.id}\n".encode() in header
    assert (received.binary, received.header.frame_id, received.resolution) == (True, "map", 0.5)
