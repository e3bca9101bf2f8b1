"""rviz/foxglove_layout.json names what the nodes publish, and settings that Foxglove has for it.

Settings and types of topics are those of the open Foxglove Studio 1.48 (MPL-2.0), which ignores any others.
"""

import json
import re

import pytest
from programs import ROOT

from node_support.node_table import DIAGNOSTICS, NODES, NodeDescription, Role

LAYOUT = json.loads((ROOT / "rviz/foxglove_layout.json").read_text())
PANELS = {name.partition("!")[0]: panel for name, panel in LAYOUT["configById"].items()}
INTERFACES = [one for node in NODES.values() if isinstance(node, NodeDescription) for one in node.interfaces]
TOPIC_KEYS = {
    "visualization_msgs/MarkerArray": {"visible", "color", "selectedIdVariable", "namespaces"},
    "nav_msgs/Path": {"visible", "type", "axisScale", "arrowScale", "lineWidth", "gradient"},
    "nav_msgs/OccupancyGrid": {
        "visible", "minColor", "maxColor", "unknownColor", "invalidColor", "frameLocked", "colorMode", "alpha",
    },
    "sensor_msgs/PointCloud2": {
        "visible", "colorMode", "flatColor", "pointSize", "pointShape", "decayTime", "colorField", "colorMap",
        "gradient", "explicitAlpha", "minValue", "maxValue",
    },
}  # fmt: skip


def kinds(topic, role=Role.OUTPUT):
    """Return the types that nodes give a topic in a role."""
    return {one.type for one in (*INTERFACES, DIAGNOSTICS) if one.role is role and f"/{one.name.lstrip('/')}" == topic}


@pytest.mark.parametrize("topic", PANELS["3D"]["topics"])
def test_each_topic_that_is_drawn_is_published_with_a_type_that_has_these_settings(topic):
    (kind,) = kinds(topic)
    assert set(PANELS["3D"]["topics"][topic]) <= TOPIC_KEYS[kind]


def test_diagnostics_and_plotted_fields_are_published():
    assert kinds(PANELS["DiagnosticSummary"]["topicToRender"]) == {"diagnostic_msgs/DiagnosticArray"}
    plotted = [re.fullmatch(r"(.+)\.pose\.covariance\[(0|7)\]", one["value"]) for one in PANELS["Plot"]["paths"]]
    assert {kind for one in plotted for kind in kinds(one.group(1))} == {"geometry_msgs/PoseWithCovarianceStamped"}


def test_the_pose_that_is_clicked_is_taken():
    asked = PANELS["3D"]["publish"]
    assert asked["type"] == "pose_estimate"
    assert kinds(asked["poseEstimateTopic"], Role.INPUT) == {"geometry_msgs/PoseWithCovarianceStamped"}


def test_every_panel_stands_in_the_window():
    def named(part):
        return {part} if isinstance(part, str) else named(part["first"]) | named(part["second"])

    assert named(LAYOUT["layout"]) == set(LAYOUT["configById"])
