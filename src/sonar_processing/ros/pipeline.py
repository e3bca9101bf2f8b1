"""A stage as a node, and the chain of stages in one process: arrays go from stage to stage, nothing is copied."""

from collections import defaultdict
from functools import partial
from typing import TYPE_CHECKING, Callable, Collection, Dict, List, Mapping, Optional, Sequence, Tuple

import numpy as np
import rospy

from node_support import topics
from node_support.errors import RefusedInput
from node_support.health import Health
from node_support.help import answer_help
from node_support.parameters import ParameterError, ParameterSet
from node_support.ros.callbacks import make_health
from node_support.ros.node import run
from node_support.ros.reconfigurable_parameters import ReconfigurableParameters, kept_by_master
from sonar_processing.beams.beam import Beam
from sonar_processing.cloud import NOBODY, Cloud, CloudSink
from sonar_processing.filters.stage_table import SCANS_IN_A_ROW, STAGES, EmptiedScans
from sonar_processing.ros.cloud_topics import (
    CloudPublisher,
    FigurePublisher,
    SonarPlaces,
    report_broken,
    subscribe_to_clouds,
)
from sonar_processing.ros.sonar_image import SonarImage
from sonar_processing.ros.sonar_to_cloud import SonarToCloud


class StageRunner:
    """Runs one stage of the table, as a node of its own or called by the process that hosts it."""

    def __init__(self, name: str, namespace: str) -> None:
        """Raises ParameterError for a bad parameter in `namespace`."""
        self.health = make_health(name)
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
        points = int(np.count_nonzero(result.valid))
        self.health.count("clouds out")
        self.health.count("points out", points)
        if self._emptied.take(int(np.count_nonzero(cloud.valid)), points):
            self.health.problem("scans in a row lost all points", self.type.when_empty, SCANS_IN_A_ROW)
        self._publishers[topic].publish(result)
        for figure in self._figures:
            figure.publish(self.type.figures[figure.name](stage))
        return result


def run_stage(name: str) -> None:
    answer_help(name, STAGES[name].parameters)
    run(name, lambda: StageRunner.as_node(name))


if TYPE_CHECKING:
    from sonar_processing.ros.shape_detectors import ShapeDetectorNode

DEFAULT_CHAIN = ["thresholder", "outlier_remover", "echo_extractor"]
_OWN_PARAMETERS = "chain", "detectors"


class StageChain:
    """Stages one after the other; each gets what the one before made."""

    def __init__(self, links: Sequence[Tuple[StageRunner, str]], sinks: Mapping[str, Sequence[CloudSink]]) -> None:
        """links: stages with the topics that they take. `sinks` receive what they make, by the topics of that."""
        self._links = [(runner, topic, sinks.get(runner.type.outputs[topic], ())) for runner, topic in links]

    def is_wanted(self) -> bool:
        return any(
            runner.is_read(topic) or any(sink.is_wanted() for sink in sinks) for runner, topic, sinks in self._links
        )

    def process(self, scan: Cloud) -> None:
        cloud: Optional[Cloud] = scan
        for runner, topic, sinks in self._links:
            cloud = runner.process(topic, cloud)
            if cloud is None:
                return
            for sink in sinks:
                if sink.is_wanted():
                    sink.take(cloud)


class Pipeline:
    """Hosts the stages named by `~chain`, the detectors named by `~detectors` and sonar_image.

    All have the parameters and topics they have as nodes. Stages that take polar scans run beside the others, and, as
    detectors do, only while somebody subscribes to their results.
    """

    def __init__(
        self, cloud_sink: CloudSink = NOBODY, echo_sink: CloudSink = NOBODY,
        beam_sink: Callable[[Beam], None] = lambda _: None,
    ) -> None:  # fmt: skip
        """`cloud_sink` receives what leaves the last stage of clouds, `echo_sink` the last of polar scans.

        `beam_sink` receives each beam. Raises ParameterError for a bad parameter of any stage or detector.
        """
        _refuse_other_names()
        runners = [StageRunner(name, rospy.resolve_name(name)) for name in _names("chain", DEFAULT_CHAIN, STAGES)]
        detectors = _detectors({made for runner in runners for made in runner.type.outputs.values()})
        sinks: Dict[str, List[CloudSink]] = defaultdict(list)
        for detector in detectors:
            sinks[detector.input_topic].append(detector.sink())
        links = [(runner, topic) for runner in runners for topic in runner.type.outputs]
        clouds = _stage_chain([link for link in links if link[1] != topics.POLAR_SCANS], sinks, cloud_sink)
        polar = _stage_chain([link for link in links if link[1] == topics.POLAR_SCANS], sinks, echo_sink)
        self._source = SonarToCloud(
            rospy.resolve_name("sonar_to_cloud"),
            CloudSink(clouds.process, clouds.is_wanted),
            CloudSink(polar.process, polar.is_wanted),
            beam_sink,
        )
        self._image = SonarImage(rospy.resolve_name("sonar_image"))
        self.healths: List[Health] = [one.health for one in (self._source, *runners, *detectors, self._image)]


def _detectors(made: Collection[str]) -> List["ShapeDetectorNode"]:
    """Return the detectors; each needs a stage whose output, one of the topics `made`, is its input."""
    if not rospy.get_param("~detectors", []):
        return []
    # Here, because it loads scipy.optimize.
    from sonar_processing.ros.shape_detectors import DETECTORS

    names = _names("detectors", [], DETECTORS)
    detectors = [DETECTORS[name](rospy.resolve_name(name)) for name in names]
    for detector in detectors:
        if detector.input_topic not in made:
            raise ParameterError(f"detectors = {names!r}: no stage of chain makes {detector.input_topic}")
    return detectors


def _refuse_other_names() -> None:
    for name, value in (rospy.get_param("~", {}) or {}).items():
        if name not in _OWN_PARAMETERS:
            raise ParameterError(
                f"{name} = {value!r}: no such parameter; there are {', '.join(_OWN_PARAMETERS)}, and under the name of "
                f"each stage its own, as /thresholder/otsu_multiplier {kept_by_master('~')}"
            )


def _names(parameter: str, default: List[str], known: Collection[str]) -> List[str]:
    names = rospy.get_param(f"~{parameter}", default)
    if not isinstance(names, list) or not all(name in known for name in names):
        raise ParameterError(f"{parameter} = {names!r}: must be a list of {', '.join(known)}")
    return names


def _stage_chain(
    links: Sequence[Tuple[StageRunner, str]], sinks: Dict[str, List[CloudSink]], last: CloudSink
) -> StageChain:
    """Return a chain that gives what the last stage makes to `last` too."""
    if links:
        runner, topic = links[-1]
        sinks[runner.type.outputs[topic]].append(last)
    return StageChain(links, sinks)
