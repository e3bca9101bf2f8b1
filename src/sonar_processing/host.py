"""sonar_to_cloud and the chain of stages in one process: arrays go from stage to stage, nothing is copied."""

from typing import Callable, List, Optional

import rospy

from node_support.health import Health
from node_support.parameters import ParameterError
from sonar_processing.cloud import IntensityCloud
from sonar_processing.sonar_to_cloud import SonarToCloud
from sonar_processing.stage_runner import StageRunner
from sonar_processing.stages import STAGES

DEFAULT_CHAIN = ["thresholder", "outlier_remover"]


class ProcessingHost:
    """Hosts the stages named by `~chain`, each with the parameters and topics it has as a node of its own."""

    def __init__(self, deliver: Optional[Callable[[IntensityCloud], None]] = None) -> None:
        """`deliver` receives what leaves the last stage. Raises ParameterError for a bad parameter of any stage."""
        self._deliver = deliver
        self._runners = [StageRunner(name, rospy.resolve_name(name)) for name in _chain()]
        self._source = SonarToCloud(rospy.resolve_name("sonar_to_cloud"), self._process)

    @property
    def healths(self) -> List[Health]:
        """The health of every stage, in the order of the chain."""
        return [self._source.health] + [runner.health for runner in self._runners]

    def _process(self, scan: IntensityCloud) -> None:
        cloud: Optional[IntensityCloud] = scan
        for runner in self._runners:
            cloud = runner.process(cloud)
            if cloud is None:
                return
        if self._deliver is not None:
            self._deliver(cloud)


def _chain() -> List[str]:
    chain = rospy.get_param("~chain", DEFAULT_CHAIN)
    if not isinstance(chain, list) or not all(name in STAGES for name in chain):
        raise ParameterError(f"chain = {chain!r}: must be a list of {', '.join(STAGES)}")
    return chain
