#!/usr/bin/env python3
"""Every node: its topics, and what it takes and refuses of parameters at its start and while it runs."""

import signal
import subprocess
import sys
import unittest
from concurrent.futures import ThreadPoolExecutor
from dataclasses import Field
from enum import Enum
from typing import Any, Dict, List, Set, Tuple

import rosgraph
import rospy
from dynamic_reconfigure.client import Client
from graph import PACKAGE_ROOT, PATIENCE, Diagnostics, Inbox, ended, run, wait_until
from sensor_msgs.msg import Image

sys.path.insert(0, str(PACKAGE_ROOT / "scripts"))

from document import LIVE_NODES

from mlsm_manager.ros.map_publisher import has_octomap_messages
from node_support.node_table import HOSTS, NODES, Role
from node_support.parameters import describe

# What every node has through rospy, tf and dynamic_reconfigure.
COMMON = {"/rosout", "/diagnostics", "/clock", "/tf", "/tf_static"}
COMMON_ENDINGS = (
    "/parameter_descriptions", "/parameter_updates", "/set_parameters", "/get_loggers", "/set_logger_level",
)  # fmt: skip
# What a node has with other parameters than it has here, and where messages are installed that are missing here.
OPTIONAL = {
    "sonar_simulator": {"/cmd_vel", "/imu", "/depth"},
    "autopilot_link": {"/mavros/odometry/out", "/mavros/vision_pose/pose_cov"},
    "dead_reckoning": {"/cmd_vel", "/depth", "/dvl"},
    "mlsm_core": set() if has_octomap_messages() else {"/MLSM/octomap"},
}

# Beyond what dynamic_reconfigure itself refuses to send: an integer has 32 bits there.
INT_LIMIT = 2**31 - 1
REFUSED = "changes of parameters refused"
# Node, parameter, and what its last line tells of it.
BAD_STARTS: List[Tuple[str, str, str]] = [
    ("sonar_simulator", "world:=/nowhere.sdf", "/nowhere.sdf"),
    ("gazebo_sonar", "head:=TURN", "head = 'TURN'"),
    ("sonar_processing", "chain:=[none_such]", "none_such"),
    ("thresholder", "otsu_multiplier:=.nan", "otsu_multiplier = nan: must be a number from 0 to 10"),
    ("imagenex_852_driver", "max_range:=7", "max_range = 7: not allowed by the protocol, which takes 5, 10"),
    ("ping360_driver", "port:=udp://nowhere", "must be udp://HOST:PORT"),
]
# A stage that a host may run, and such a host: all nodes read their parameters as one of these does.
UNKNOWN = "no_such_parameter:=1", "no_such_parameter = 1: no such parameter"
BAD_STARTS += [(node, *UNKNOWN) for node in ("mlsm_core", "mapping")]


def bad_values(field: Field) -> List[Any]:
    """Return values of the field's own type that are not allowed."""
    if issubclass(field.type, Enum):
        return ["NONE_SUCH", "", field.default.value.lower() + " "]
    described = describe(field)
    if field.type is str:
        return [] if described.may_be_empty else [""]
    if field.type is float:
        bounds = [described.low - 1.0 if described.low is not None else None]
        bounds.append(described.high * 2.0 + 1.0 if described.high is not None else None)
        return [float("nan"), float("inf"), -float("inf"), *(bound for bound in bounds if bound is not None)]
    if field.type is int:
        low = [described.low - 1, described.low - 1000] if described.low is not None else []
        has_high = described.high is not None and described.high < INT_LIMIT
        return [*low, *([described.high + 1, described.high + 1000] if has_high else [])]
    return []


def start(case: Tuple[int, Tuple[str, str, str]]) -> "subprocess.CompletedProcess[str]":
    """Run a node that must end by itself."""
    number, (node, parameter, _) = case
    # What the simulator of the graph tells tf would be worth a warning.
    others = (f"__name:=bad_start_{number}", "/tf:=/elsewhere/tf")
    command = [str(PACKAGE_ROOT / "nodes" / node), *others, f"_{parameter}"]
    if node in HOSTS:
        # Else it would take the services of the nodes that it hosts from those that run.
        command.append("__ns:=elsewhere")
    return ended(command, 2 * PATIENCE, ROSCONSOLE_FORMAT="${message}")


class EveryNode(unittest.TestCase):
    """Compares topics with the table of docs/nodes.md and --help; sends what the parameter dataclasses do not allow."""

    def test_every_node_has_what_the_table_says_and_nothing_else(self) -> None:
        """Without what all nodes have in common; sonar_image takes beams only while somebody looks at its image."""
        viewer = Inbox("/sonar/image", Image)
        wait_until(lambda: _differences() == {}, required=False)
        self.assertEqual(_differences(), {})
        viewer.close()

    def test_keys_of_an_older_version_are_named_in_one_warning_and_taken(self) -> None:
        """Also those that stand beside `expert` and not under it: the server then holds them where they belong."""
        keys = ("_kernel:=NUMBA", "_free_scans:=30", "_normal_deviation:=0.2")
        command = [str(PACKAGE_ROOT / "nodes/mlsm_core"), "__name:=old_keys", *keys]
        with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True) as node:
            wait_until(lambda: rospy.has_param("/old_keys/transform_tolerance"))
            held = rospy.get_param("/old_keys")
            node.send_signal(signal.SIGINT)
            told = [line for line in node.communicate(timeout=PATIENCE)[0].splitlines() if "an older version" in line]
        self.assertEqual(len(told), 1, told)
        self.assertIn("kernel -> nothing", told[0])
        self.assertIn("under expert belong free_scans, normal_deviation", told[0])
        self.assertEqual((held["expert"]["free_scans"], held["expert"]["normal_deviation"]), (30, 0.2))
        self.assertNotIn("normal_deviation", held)

    def test_a_change_of_what_is_for_experts_is_held_where_the_node_reads_it(self) -> None:
        client = Client("/mlsm_core", timeout=PATIENCE)
        client.update_configuration({"max_iterations": 21})
        self.assertEqual(rospy.get_param("/mlsm_core/expert/max_iterations"), 21)
        self.assertFalse(rospy.has_param("/mlsm_core/max_iterations"))
        client.close()

    def test_a_good_change_is_taken_while_running(self) -> None:
        client = Client("/thresholder", timeout=PATIENCE)
        self.assertEqual(client.update_configuration({"otsu_multiplier": 2.0})["otsu_multiplier"], 2.0)
        self.assertEqual(rospy.get_param("/thresholder/otsu_multiplier"), 2.0)
        client.close()

    def test_every_bad_value_of_every_parameter_is_refused_while_running(self) -> None:
        diagnostics, accepted, sent = Diagnostics(), [], 0
        for node in sorted(LIVE_NODES):
            client = Client(f"/{node}", timeout=PATIENCE)
            counted = diagnostics.known(node, REFUSED)
            before = client.get_configuration(timeout=PATIENCE)
            refused = 0
            for field in LIVE_NODES[node].tunable_fields():
                for value in bad_values(field):
                    answer: Dict[str, Any] = client.update_configuration({field.name: value})
                    refused += 1
                    if answer[field.name] != before[field.name]:
                        accepted.append(f"{node} {field.name} = {value!r}")
            client.close()
            diagnostics.wait_for(node, REFUSED, counted + refused)
            held = rospy.get_param(f"/{node}")
            accepted += [f"{node}: {key} = {held[key]!r}" for key in before.keys() & held if held[key] != before[key]]
            sent += refused
        print(f"{sent} bad values sent")
        self.assertEqual(accepted, [])
        self.assertGreater(sent, 300)

    def test_a_change_of_which_one_value_is_bad_is_refused_whole(self) -> None:
        client = Client("/outlier_remover", timeout=PATIENCE)
        answer = client.update_configuration({"mode": "RADIUSES", "mean_k": 30})
        self.assertEqual((answer["mode"], answer["mean_k"]), ("STATISTICAL", 20))
        client.close()

    def test_every_bad_start_ends_with_one_line(self) -> None:
        port = f"port:={rospy.get_param('/imagenex_852_driver/port')}"
        cases = [*BAD_STARTS, ("imagenex_852_driver", port, "in use by another program")]
        with ThreadPoolExecutor(max_workers=2) as pool:
            ends = list(pool.map(start, enumerate(cases)))
        wrong = []
        for case, done in zip(cases, ends):
            lines = [line for line in done.stdout.splitlines() if line.strip()]
            if done.returncode != 1 or len(lines) != 1 or case[-1] not in lines[0]:
                wrong.append((case, done.returncode, done.stdout))
        self.assertEqual(wrong, [])


def _differences() -> Dict[str, str]:
    publishers, subscribers, services = rosgraph.Master("/every_node_test").getSystemState()
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


if __name__ == "__main__":
    run(EveryNode)
