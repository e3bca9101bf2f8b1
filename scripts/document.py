"""Writes the generated files: the default yaml files, tables in docs, and the files that make filters nodes.

The tables are those of docs/nodes.md and docs/from_2015.md. A filter in the table of stages gets an executable, a
dynamic_reconfigure description and a launch file.
"""

import argparse
import inspect
import sys
from pathlib import Path
from typing import Dict, Type

import yaml
from from_2015 import from_2015_tables
from parameter_text import default_yaml, markdown_table, start_up_yaml

from autopilot_link.parameters import AutopilotLinkParameters
from dead_reckoning.dead_reckoner import DeadReckoningParameters
from imagenex_852_driver.emulated_852 import EmulatorParameters
from imagenex_852_driver.parameters import DriverParameters
from mlsm_manager.localisation.parameters import MlsmCoreParameters
from node_support.node_table import NODES, NodeDescription
from node_support.parameters import ParameterSet, config_name
from node_support.thin_queue import ThinLinkParameters
from ping360_driver.emulated_ping360 import EmulatorParameters as Ping360EmulatorParameters
from ping360_driver.parameters import DriverParameters as Ping360DriverParameters
from sonar_processing.filters.stage_table import STAGES
from sonar_processing.scans.image import SonarImageParameters
from sonar_processing.scans.parameters import SonarToCloudParameters
from sonar_processing.scans.tilt_scan import SonarControlParameters
from sonar_processing.shapes.circles import CircleDetectorParameters
from sonar_processing.shapes.lines import LineDetectorParameters
from sonar_simulator import gazebo_parameters
from sonar_simulator.simulation.simulation import GROUPS, SimulatorParameters
from web_page.parameters import WebPageParameters

ROOT = Path(__file__).resolve().parent.parent
EXECUTABLE = """\
#!/usr/bin/env python3
from sonar_processing.ros.pipeline import run_stage

run_stage("{name}")
"""
CONFIGURATION = """\
#!/usr/bin/env python3
import os
import sys

sys.path.insert(0, os.path.join(os.path.dirname(os.path.realpath(__file__)), os.pardir, "src"))

from node_support.ros.reconfigure_description import generate
from sonar_processing.filters.stage_table import STAGES

sys.exit(generate(STAGES["{name}"].parameters, "{config}"))
"""
LAUNCH = """\
<launch>
  <!-- {name} as a node of its own. {summary} -->
  <arg name="yaml" default="$(find underwater_map_construction)/yaml/{name}_default.yaml"
       doc="file of the node's parameters"/>
  <arg name="respawn" default="false" doc="true: start the node again whenever it ends"/>
  <node name="{name}" pkg="underwater_map_construction" type="{name}" output="screen"
        respawn="$(arg respawn)">
    <rosparam command="load" file="$(arg yaml)"/>
  </node>
</launch>
"""


LIVE_NODES: Dict[str, Type[ParameterSet]] = {
    "autopilot_link": AutopilotLinkParameters,
    "circle_detector": CircleDetectorParameters,
    "dead_reckoning": DeadReckoningParameters,
    "imagenex_852_driver": DriverParameters,
    "imagenex_852_emulator": EmulatorParameters,
    "line_detector": LineDetectorParameters,
    "mlsm_core": MlsmCoreParameters,
    "ping360_driver": Ping360DriverParameters,
    "ping360_emulator": Ping360EmulatorParameters,
    "sonar_control": SonarControlParameters,
    "sonar_image": SonarImageParameters,
    "sonar_to_cloud": SonarToCloudParameters,
    **{name: stage.parameters for name, stage in STAGES.items()},
}
"""Nodes with dynamic_reconfigure."""
START_UP_NODES: Dict[str, Type[ParameterSet]] = {
    "sonar_simulator": SimulatorParameters,
    "gazebo_sonar": gazebo_parameters.GazeboSonarParameters,
    "thin_link": ThinLinkParameters,
    "web_page": WebPageParameters,
}
"""Nodes that read their parameters only when they start."""


def generated() -> Dict[Path, str]:
    """Return the whole text of every generated file."""
    texts = {
        ROOT / f"yaml/{name}_default.yaml": default_yaml(name, parameters) for name, parameters in LIVE_NODES.items()
    }
    groups = {"sonar_simulator": GROUPS, "gazebo_sonar": gazebo_parameters.GROUPS, "thin_link": {}, "web_page": {}}
    for name, parameters in START_UP_NODES.items():
        texts[ROOT / f"yaml/{name}_default.yaml"] = start_up_yaml(name, parameters, groups[name])
    for name, stage in STAGES.items():
        words = {"name": name, "config": config_name(name), "summary": inspect.getdoc(stage.build).splitlines()[0]}
        texts[ROOT / f"nodes/{name}"] = EXECUTABLE.format(**words)
        texts[ROOT / f"cfg/{config_name(name)}.cfg"] = CONFIGURATION.format(**words)
        texts[ROOT / f"launch/{name}.launch"] = LAUNCH.format(**words)
    thesis = yaml.safe_load((ROOT / "yaml/thesis.yaml").read_text())
    pages = {"nodes": nodes_sections(), "from_2015": from_2015_tables(LIVE_NODES, thesis)}
    for name, tables in pages.items():
        path = ROOT / f"docs/{name}.md"
        # What stands before the first generated heading is written by hand.
        texts[path] = path.read_text().partition(tables[: tables.index("\n") + 1])[0] + tables
    return texts


def nodes_sections() -> str:
    """Return the sections of docs/nodes.md: purpose, topics, services and parameters of every node."""
    return "\n".join(_node_section(name, node, _parameter_tables(name)) for name, node in NODES.items())


def _node_section(name: str, node: NodeDescription, tables: Dict[str, str]) -> str:
    lines = [f"## {name}", "", node.summary, "", "| | name | type | |", "| --- | --- | --- | --- |"]
    for one in node.interfaces:
        kind = f"`{one.type}`" if one.type else ""
        lines.append(f"| {one.role.value} | `{one.name}` | {kind} | {one.text} |")
    for title, table in tables.items():
        lines += ["", f"<details><summary>{title}</summary>", "", table, "</details>"]
    return "\n".join(lines) + "\n"


def _parameter_tables(node: str) -> Dict[str, str]:
    """Return the parameter tables of a node by their titles."""
    if node in LIVE_NODES:
        return {"Parameters": markdown_table(LIVE_NODES[node])}
    if node not in START_UP_NODES:
        return {}
    tables = {"Parameters": markdown_table(START_UP_NODES[node], live=False)}
    if node == "sonar_simulator":
        groups = {name: markdown_table(group, live=False) for name, group in GROUPS.items()}
        tables.update({f"Parameters in the group <code>{name}</code>": table for name, table in groups.items()})
    return tables


def main() -> int:
    """Write the files, or with --check name those that are not up to date and return 1."""
    parser = argparse.ArgumentParser(prog="scripts/document", description=__doc__)
    parser.add_argument("--check", action="store_true", help="write nothing; fail when a file is not up to date")
    check = parser.parse_args().check
    stale = [path for path, text in generated().items() if not path.exists() or path.read_text() != text]
    for path in stale:
        print(f"{path.relative_to(ROOT)}: {'not up to date; run scripts/document' if check else 'written'}")
        if not check:
            text = generated()[path]
            path.write_text(text)
            path.chmod(0o755 if text.startswith("#!") else 0o644)
    return int(check and bool(stale))


if __name__ == "__main__":
    sys.exit(main())
