"""Writes what is generated from the parameter dataclasses: the default yaml files and the tables of the documents."""

import argparse
import dataclasses
import re
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Dict, Type

from imagenex_852_driver.emulator.parameters import EmulatorParameters
from imagenex_852_driver.line.parameters import DriverParameters
from mlsm_manager.localisation.parameters import MlsmCoreParameters
from node_support.parameter_text import default_yaml, markdown_table
from node_support.parameters import ParameterSet, describe
from sonar_processing.filters.echo_extraction import EchoExtractorParameters
from sonar_processing.filters.outliers import OutlierRemoverParameters
from sonar_processing.filters.threshold import ThresholderParameters
from sonar_processing.scans.image import SonarImageParameters
from sonar_processing.scans.parameters import SonarToCloudParameters
from sonar_processing.servo.tilt_scan import SonarControlParameters
from sonar_processing.shapes.circles import CircleDetectorParameters
from sonar_processing.shapes.lines import LineDetectorParameters
from sonar_simulator.default_yaml import gazebo_sonar_yaml, simulator_yaml
from sonar_simulator.gazebo.parameters import GazeboSonarParameters
from sonar_simulator.simulation.simulation import SimulatorParameters
from sonar_simulator.simulation.simulation_setup import GROUPS

ROOT = Path(__file__).resolve().parent.parent
DOCUMENTS = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
_BLOCK = re.compile(r"(<!-- parameters: ([\w/]+) -->\n).*?(<!-- end -->)", re.DOTALL)


@dataclass(frozen=True)
class LiveNode:
    """A node with dynamic_reconfigure: its parameters and the name of its cfg file."""

    parameters: Type[ParameterSet]
    config_name: str


LIVE_NODES: Dict[str, LiveNode] = {
    "circle_detector": LiveNode(CircleDetectorParameters, "CircleDetector"),
    "echo_extractor": LiveNode(EchoExtractorParameters, "EchoExtractor"),
    "imagenex_852_driver": LiveNode(DriverParameters, "Imagenex852"),
    "imagenex_852_emulator": LiveNode(EmulatorParameters, "Imagenex852Emulator"),
    "line_detector": LiveNode(LineDetectorParameters, "LineDetector"),
    "mlsm_core": LiveNode(MlsmCoreParameters, "MlsmCore"),
    "outlier_remover": LiveNode(OutlierRemoverParameters, "OutlierRemover"),
    "sonar_control": LiveNode(SonarControlParameters, "SonarControl"),
    "sonar_image": LiveNode(SonarImageParameters, "SonarImage"),
    "sonar_to_cloud": LiveNode(SonarToCloudParameters, "SonarToCloud"),
    "thresholder": LiveNode(ThresholderParameters, "Thresholder"),
}


def generated() -> Dict[Path, str]:
    """Return the whole text of every generated file. Raises KeyError for a table of an unknown node."""
    texts = {
        ROOT / f"yaml/{name}_default.yaml": default_yaml(name, node.parameters) for name, node in LIVE_NODES.items()
    }
    texts[ROOT / "yaml/sonar_simulator_default.yaml"] = simulator_yaml()
    texts[ROOT / "yaml/gazebo_sonar_default.yaml"] = gazebo_sonar_yaml()
    texts.update({path: with_tables(path.read_text()) for path in DOCUMENTS})
    texts[ROOT / "docs/thesis_names.md"] = thesis_names()
    return texts


def thesis_names() -> str:
    """Return the table that pairs the parameter names of the thesis with ours."""
    lines = ["# Parameters of the thesis and their names here", "", "| node | thesis | here |", "| --- | --- | --- |"]
    for name, node in LIVE_NODES.items():
        for field in dataclasses.fields(node.parameters):
            thesis_name = describe(field).thesis_name
            if thesis_name:
                lines.append(f"| {name} | {thesis_name} | `{field.name}` |")
    return "\n".join(lines) + "\n"


def with_tables(text: str) -> str:
    """Return the text with every block "<!-- parameters: NODE --> ... <!-- end -->" made anew."""
    tables = {name: markdown_table(node.parameters) for name, node in LIVE_NODES.items()}
    tables["sonar_simulator"] = markdown_table(SimulatorParameters, live=False)
    tables["gazebo_sonar"] = markdown_table(GazeboSonarParameters, live=False)
    tables.update({f"sonar_simulator/{name}": markdown_table(group, live=False) for name, group in GROUPS.items()})
    return _BLOCK.sub(lambda block: f"{block[1]}\n{tables[block[2]]}\n{block[3]}", text)


def main() -> int:
    """Write the files, or with --check name those that are not up to date and return 1."""
    parser = argparse.ArgumentParser(prog="scripts/document", description=__doc__)
    parser.add_argument("--check", action="store_true", help="write nothing; fail when a file is not up to date")
    check = parser.parse_args().check
    stale = [path for path, text in generated().items() if not path.exists() or path.read_text() != text]
    for path in stale:
        print(f"{path.relative_to(ROOT)}: {'not up to date; run scripts/document' if check else 'written'}")
        if not check:
            path.write_text(generated()[path])
    return int(check and bool(stale))


if __name__ == "__main__":
    sys.exit(main())
