"""The executables of this package."""

import rospy

from mlsm_manager.ros.mlsm_core import MlsmCore
from node_support.ros.node import DiagnosticsPublisher, run
from sonar_processing.ros.pipeline import ProcessingHost


def run_mlsm_core() -> None:
    """Run the map as a node of its own."""

    def construct() -> tuple:
        core = MlsmCore()
        core.subscribe()
        return core, DiagnosticsPublisher([core.health])

    run("mlsm_core", construct)


def run_mapping() -> None:
    """Run everything from beams to map in one process."""

    def construct() -> tuple:
        core = MlsmCore(rospy.resolve_name("mlsm_core"))
        host = ProcessingHost(core.insert, core.match)
        return core, host, DiagnosticsPublisher([*host.healths, core.health])

    run("mapping", construct)
