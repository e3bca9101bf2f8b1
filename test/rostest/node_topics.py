"""The table behind docs/nodes.md and --help lists the topics and services that the nodes really have."""

import unittest
from typing import Dict, Set

import rosgraph
import rospy
from graph import Inbox, wait_until
from sensor_msgs.msg import Image

from mlsm_manager.ros.map_publisher import has_octomap_messages
from node_support.node_table import NODES, Role

PACKAGE = "underwater_map_construction"
# What every node has through rospy, tf and dynamic_reconfigure.
COMMON = {"/rosout", "/diagnostics", "/clock", "/tf", "/tf_static"}
COMMON_ENDINGS = (
    "/parameter_descriptions",
    "/parameter_updates",
    "/set_parameters",
    "/get_loggers",
    "/set_logger_level",
)
# What a node has with other parameters than it has here, and where messages are installed that are missing here.
OPTIONAL = {
    "sonar_simulator": {"/cmd_vel", "/imu", "/depth"},
    "autopilot_link": {"/mavros/odometry/out", "/mavros/vision_pose/pose_cov"},
    "dead_reckoning": {"/cmd_vel", "/depth", "/dvl"},
    "mlsm_core": set() if has_octomap_messages() else {"/MLSM/octomap"},
}


class NodeTopics(unittest.TestCase):
    """Compares the table with what the master knows of the running nodes."""

    def test_every_node_has_what_the_table_says_and_nothing_else(self) -> None:
        """Without what all nodes have in common; sonar_image takes beams only while somebody looks at its image."""
        wait_until(lambda: all(f"/{node}" in _nodes() for node in NODES))
        viewer = Inbox("/sonar/image", Image)
        wait_until(lambda: _differences() == {}, required=False)
        self.assertEqual(_differences(), {})
        viewer.close()


def _nodes() -> Set[str]:
    return {node for state in rosgraph.Master("/node_topics").getSystemState() for _, nodes in state for node in nodes}


def _differences() -> Dict[str, str]:
    publishers, subscribers, services = rosgraph.Master("/node_topics").getSystemState()
    states = {Role.OUTPUT: publishers, Role.INPUT: subscribers, Role.SERVICE: services}
    found = {}
    for node in NODES:
        for role, state in states.items():
            real, told = _real(node, state), _told(node, role)
            if real - told or told - real - OPTIONAL.get(node, set()):
                found[f"{node} {role.value}"] = f"not in the table: {real - told}; only in the table: {told - real}"
    return found


def _real(node: str, state: list) -> Set[str]:
    names = {name for name, nodes in state if f"/{node}" in nodes}
    return {name for name in names - COMMON if not name.endswith(COMMON_ENDINGS)}


def _told(node: str, role: Role) -> Set[str]:
    told = set()
    for one in NODES[node].interfaces:
        if one.role is role and one.name != "tf":
            name = rospy.resolve_name(one.name, caller_id=f"/{node}")
            told |= {name, f"{name}/cloud"} if ".../cloud" in one.text else {name}
    return told - COMMON
