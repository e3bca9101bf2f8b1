"""The executables of this package. The detectors are imported by those who run them, for they load scipy.optimize."""

from node_support.ros.node import run
from sonar_processing.ros.pipeline import Pipeline
from sonar_processing.ros.sonar_control import SonarControl
from sonar_processing.ros.sonar_image import SonarImage
from sonar_processing.ros.sonar_to_cloud import SonarToCloud
from sonar_processing.ros.stage_runner import StageRunner


def run_sonar_to_cloud() -> None:
    """Run sonar_to_cloud as a node of its own."""
    run("sonar_to_cloud", SonarToCloud)


def run_stage(name: str) -> None:
    """Run one stage of the table as a node of its own."""
    run(name, lambda: StageRunner.as_node(name))


def run_line_detector() -> None:
    """Run line_detector."""
    from sonar_processing.ros.shape_detectors import LineDetectorNode

    run("line_detector", LineDetectorNode.as_node)


def run_circle_detector() -> None:
    """Run circle_detector."""
    from sonar_processing.ros.shape_detectors import CircleDetectorNode

    run("circle_detector", CircleDetectorNode.as_node)


def run_sonar_control() -> None:
    """Run sonar_control."""
    run("sonar_control", SonarControl)


def run_sonar_image() -> None:
    """Run sonar_image as a node of its own."""
    run("sonar_image", SonarImage)


def run_pipeline() -> None:
    """Run sonar_to_cloud and the chain in one process."""
    run("sonar_processing", Pipeline)
