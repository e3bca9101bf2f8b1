"""The executables of this package."""

from typing import List

import rospy

from mlsm_manager.ros.mlsm_core import MlsmCore
from node_support.health import Health
from node_support.ros.node import run
from sonar_processing.cloud import CloudSink
from sonar_processing.ros.pipeline import Pipeline


class Mapping:
    """Everything from beams to map in one process."""

    def __init__(self) -> None:
        """Raises ParameterError for a bad parameter of any stage."""
        self._core = MlsmCore(rospy.resolve_name("mlsm_core"))
        self._pipeline = Pipeline(CloudSink(self._core.insert), CloudSink(self._core.match))
        self.healths: List[Health] = [*self._pipeline.healths, *self._core.healths]


def run_mlsm_core() -> None:
    """Run the map as a node of its own."""
    run("mlsm_core", MlsmCore.as_node)


def run_mapping() -> None:
    """Run everything from beams to map in one process."""
    run("mapping", Mapping)
