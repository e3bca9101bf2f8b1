"""sonar_to_cloud and the chain of stages in one process: arrays go from stage to stage, nothing is copied."""

from typing import Callable, List, Optional

import rospy

from node_support.health import Health
from node_support.parameters import ParameterError
from sonar_processing.cloud import IntensityCloud
from sonar_processing.filters.stage_table import STAGES
from sonar_processing.ros.sonar_image import SonarImage
from sonar_processing.ros.sonar_to_cloud import SonarToCloud
from sonar_processing.ros.stage_runner import StageRunner

DEFAULT_CHAIN = ["thresholder", "outlier_remover", "echo_extractor"]
Deliver = Callable[[IntensityCloud], None]


class StageChain:
    """Stages one after the other; each gets what the one before made."""

    def __init__(self, runners: List[StageRunner], deliver: Optional[Deliver] = None) -> None:
        """`deliver` receives what leaves the last stage."""
        self._runners = runners
        self._deliver = deliver

    @property
    def is_wanted(self) -> bool:
        """Whether anybody takes anything that the stages make."""
        return bool(self._runners and self._deliver) or any(runner.is_read for runner in self._runners)

    def process(self, scan: IntensityCloud) -> None:
        """Take a cloud through all stages."""
        cloud: Optional[IntensityCloud] = scan
        for runner in self._runners:
            cloud = runner.process(cloud)
            if cloud is None:
                return
        if self._deliver is not None:
            self._deliver(cloud)


class ProcessingHost:
    """Hosts the stages named by `~chain` and sonar_image, with the parameters and topics they have as nodes.

    Stages that take polar scans run beside the others, and only while somebody wants what they make.
    """

    def __init__(self, deliver: Optional[Deliver] = None, deliver_echoes: Optional[Deliver] = None) -> None:
        """`deliver` receives what leaves the last stage of clouds, `deliver_echoes` the last of polar scans.

        Raises ParameterError for a bad parameter of any stage.
        """
        runners = [StageRunner(name, rospy.resolve_name(name)) for name in _chain()]
        clouds = StageChain([runner for runner in runners if not runner.takes_polar_scans], deliver)
        polar = StageChain([runner for runner in runners if runner.takes_polar_scans], deliver_echoes)
        self._source = SonarToCloud(rospy.resolve_name("sonar_to_cloud"), clouds.process, polar)
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
