"""sonar_to_cloud and the chain of stages in one process: arrays go from stage to stage, nothing is copied."""

from typing import List, Optional

import rospy

from node_support.health import Health
from node_support.parameters import ParameterError
from sonar_processing.cloud import IntensityCloud
from sonar_processing.cloud_sink import CloudSink
from sonar_processing.filters.stage_table import STAGES
from sonar_processing.ros.sonar_image import SonarImage
from sonar_processing.ros.sonar_to_cloud import SonarToCloud
from sonar_processing.ros.stage_runner import StageRunner

DEFAULT_CHAIN = ["thresholder", "outlier_remover", "echo_extractor"]


class StageChain:
    """Stages one after the other; each gets what the one before made."""

    def __init__(self, runners: List[StageRunner], sink: Optional[CloudSink] = None) -> None:
        """`sink` receives what leaves the last stage."""
        self._runners = runners
        self._sink = sink

    def is_wanted(self) -> bool:
        """Return whether anybody takes anything that the stages make."""
        is_taken = self._sink is not None and self._sink.is_wanted()
        return bool(self._runners) and (is_taken or any(runner.is_read for runner in self._runners))

    def process(self, scan: IntensityCloud) -> None:
        """Take a cloud through all stages."""
        cloud: Optional[IntensityCloud] = scan
        for runner in self._runners:
            cloud = runner.process(cloud)
            if cloud is None:
                return
        if self._sink is not None:
            self._sink.take(cloud)


class Pipeline:
    """Hosts the stages named by `~chain` and sonar_image, with the parameters and topics they have as nodes.

    Stages that take polar scans run beside the others, and only while somebody subscribes to their results.
    """

    def __init__(self, cloud_sink: Optional[CloudSink] = None, echo_sink: Optional[CloudSink] = None) -> None:
        """`cloud_sink` receives what leaves the last stage of clouds, `echo_sink` the last of polar scans.

        Raises ParameterError for a bad parameter of any stage.
        """
        runners = [StageRunner(name, rospy.resolve_name(name)) for name in _chain()]
        clouds = StageChain([runner for runner in runners if not runner.takes_polar_scans], cloud_sink)
        polar = StageChain([runner for runner in runners if runner.takes_polar_scans], echo_sink)
        self._source = SonarToCloud(
            rospy.resolve_name("sonar_to_cloud"),
            CloudSink(clouds.process, clouds.is_wanted),
            CloudSink(polar.process, polar.is_wanted),
        )
        self._image = SonarImage(rospy.resolve_name("sonar_image"))
        self.healths: List[Health] = [
            self._source.health, *[runner.health for runner in runners], self._image.health
        ]  # fmt: skip
        """The health of everything that is hosted."""


def _chain() -> List[str]:
    chain = rospy.get_param("~chain", DEFAULT_CHAIN)
    if not isinstance(chain, list) or not all(name in STAGES for name in chain):
        raise ParameterError(f"chain = {chain!r}: must be a list of {', '.join(STAGES)}")
    return chain
