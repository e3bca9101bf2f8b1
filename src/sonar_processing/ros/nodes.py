"""The executables of this package."""

from typing import Type

from node_support.ros.node import DiagnosticsPublisher, run
from sonar_processing.ros.pipeline import ProcessingHost
from sonar_processing.ros.shape_detectors import CircleDetectorNode, LineDetectorNode, ShapeDetectorNode
from sonar_processing.ros.sonar_control import SonarControl
from sonar_processing.ros.sonar_image import SonarImage
from sonar_processing.ros.sonar_to_cloud import SonarToCloud
from sonar_processing.ros.stage_runner import StageRunner


def run_sonar_to_cloud() -> None:
    """Run sonar_to_cloud as a node of its own."""

    def construct() -> tuple:
        node = SonarToCloud()
        return node, DiagnosticsPublisher([node.health])

    run("sonar_to_cloud", construct)


def run_stage(name: str) -> None:
    """Run one stage of the table as a node of its own."""

    def construct() -> tuple:
        runner = StageRunner(name, "~")
        runner.subscribe()
        return runner, DiagnosticsPublisher([runner.health])

    run(name, construct)


def run_shape_detector(kind: Type[ShapeDetectorNode]) -> None:
    """Run a detector of shapes."""

    def construct() -> tuple:
        node = kind()
        return node, DiagnosticsPublisher([node.health])

    run(kind.name, construct)


def run_line_detector() -> None:
    """Run line_detector."""
    run_shape_detector(LineDetectorNode)


def run_circle_detector() -> None:
    """Run circle_detector."""
    run_shape_detector(CircleDetectorNode)


def run_sonar_control() -> None:
    """Run sonar_control."""

    def construct() -> tuple:
        node = SonarControl()
        return node, DiagnosticsPublisher([node.health])

    run("sonar_control", construct)


def run_sonar_image() -> None:
    """Run sonar_image as a node of its own."""

    def construct() -> tuple:
        node = SonarImage()
        return node, DiagnosticsPublisher([node.health])

    run("sonar_image", construct)


def run_host() -> None:
    """Run sonar_to_cloud and the chain in one process."""

    def construct() -> tuple:
        host = ProcessingHost()
        return host, DiagnosticsPublisher(host.healths)

    run("sonar_processing", construct)
