"""sonar_to_cloud and the chain of stages in one process: arrays go from stage to stage, nothing is copied."""

from collections import defaultdict
from typing import TYPE_CHECKING, Collection, Dict, List, Mapping, Optional, Sequence, Tuple

import rospy

from node_support import topics
from node_support.health import Health
from node_support.parameters import ParameterError
from sonar_processing.cloud import Cloud, CloudSink
from sonar_processing.filters.stage_table import STAGES
from sonar_processing.ros.sonar_image import SonarImage
from sonar_processing.ros.sonar_to_cloud import SonarToCloud
from sonar_processing.ros.stage_runner import StageRunner

if TYPE_CHECKING:
    from sonar_processing.ros.shape_detectors import ShapeDetectorNode

DEFAULT_CHAIN = ["thresholder", "outlier_remover", "echo_extractor"]


class StageChain:
    """Stages one after the other; each gets what the one before made."""

    def __init__(self, links: Sequence[Tuple[StageRunner, str]], sinks: Mapping[str, Sequence[CloudSink]]) -> None:
        """links: stages with the topics that they take. `sinks` receive what they make, by the topics of that."""
        self._links = [(runner, topic, sinks.get(runner.type.outputs[topic], ())) for runner, topic in links]

    def is_wanted(self) -> bool:
        """Return whether anybody takes anything that the stages make."""
        return any(
            runner.is_read(topic) or any(sink.is_wanted() for sink in sinks) for runner, topic, sinks in self._links
        )

    def process(self, scan: Cloud) -> None:
        """Take a cloud through all stages."""
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

    def __init__(self, cloud_sink: Optional[CloudSink] = None, echo_sink: Optional[CloudSink] = None) -> None:
        """`cloud_sink` receives what leaves the last stage of clouds, `echo_sink` the last of polar scans.

        Raises ParameterError for a bad parameter of any stage or detector.
        """
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
        )
        self._image = SonarImage(rospy.resolve_name("sonar_image"))
        hosted = [self._source, *runners, *detectors, self._image]
        self.healths: List[Health] = [one.health for one in hosted]
        """The health of everything that is hosted."""


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


def _names(parameter: str, default: List[str], known: Collection[str]) -> List[str]:
    names = rospy.get_param(f"~{parameter}", default)
    if not isinstance(names, list) or not all(name in known for name in names):
        raise ParameterError(f"{parameter} = {names!r}: must be a list of {', '.join(known)}")
    return names


def _stage_chain(
    links: Sequence[Tuple[StageRunner, str]], sinks: Dict[str, List[CloudSink]], last: Optional[CloudSink]
) -> StageChain:
    """Return a chain that gives what the last stage makes to `last` too."""
    if links and last is not None:
        runner, topic = links[-1]
        sinks[runner.type.outputs[topic]].append(last)
    return StageChain(links, sinks)
