"""The ROS side of a filter stage: parameters, topics and health around a callable from cloud to cloud."""

from functools import partial
from typing import Optional

import numpy as np

from node_support.errors import RefusedInput
from node_support.help import answer_help
from node_support.parameters import ParameterSet
from node_support.ros.callbacks import make_health
from node_support.ros.node import run
from node_support.ros.reconfigurable_parameters import ReconfigurableParameters
from sonar_processing.cloud import Cloud
from sonar_processing.filters.stage_table import SCANS_IN_A_ROW, STAGES, EmptiedScans
from sonar_processing.ros.cloud_topics import CloudPublisher, FigurePublisher, report_broken, subscribe_to_clouds
from sonar_processing.ros.sonar_places import SonarPlaces


class StageRunner:
    """Runs one stage of the table, as a node of its own or called by the process that hosts it."""

    def __init__(self, name: str, namespace: str) -> None:
        """Raises ParameterError for a bad parameter in `namespace`."""
        self.health = make_health(name)
        self.healths = [self.health]
        self.type = STAGES[name]
        self._emptied = EmptiedScans()
        self._places: Optional[SonarPlaces] = None
        self._live = ReconfigurableParameters(self.type.parameters, namespace, self.health, self._use_parameters)
        self._publishers = {topic: CloudPublisher(made) for topic, made in self.type.outputs.items()}
        self._figures = [FigurePublisher(figure, namespace, self.health) for figure in self.type.figures]

    def _use_parameters(self, parameters: ParameterSet) -> None:
        if self.type.knows_sonar and self._places is None:
            self._places = SonarPlaces(parameters.sonar_frame, self.health, parameters.stamp_tolerance)
        self._stage = self.type.build(parameters, *([self._places.poses] if self._places else []))

    def is_read(self, topic: str) -> bool:
        """Return whether anybody listens to what is made of `topic`, or to a figure."""
        return self._publishers[topic].is_read or any(figure.is_read for figure in self._figures)

    @classmethod
    def as_node(cls, name: str) -> "StageRunner":
        """Return the stage `name` as a node of its own, which takes clouds from its input topic."""
        runner = cls(name, "~")
        for topic in runner.type.outputs:
            subscribe_to_clouds(topic, partial(runner.process, topic), runner.health)
        return runner

    def process(self, topic: str, cloud: Cloud) -> Optional[Cloud]:
        """Run the stage on a cloud of `topic`, publish its result and return it; None for a bad cloud (counted)."""
        self.health.count("clouds in")
        self.health.count("points in", len(cloud))
        stage = self._stage
        try:
            with self.health.timed():
                result = stage(cloud)
        except RefusedInput as refused:
            self.health.problem(refused.kind, str(refused))
            return None
        report_broken(cloud, self.health)
        self._count_out(cloud, result)
        self._publishers[topic].publish(result)
        for figure in self._figures:
            figure.publish(self.type.figures[figure.name](stage))
        return result

    def _count_out(self, cloud: Cloud, result: Cloud) -> None:
        points = int(np.count_nonzero(result.valid))
        self.health.count("clouds out")
        self.health.count("points out", points)
        if self._emptied.take(int(np.count_nonzero(cloud.valid)), points):
            self.health.problem("scans in a row lost all points", self.type.when_empty, SCANS_IN_A_ROW)


def run_stage(name: str) -> None:
    """Run one stage of the table as a node of its own."""
    answer_help(name, STAGES[name].parameters)
    run(name, lambda: StageRunner.as_node(name))
