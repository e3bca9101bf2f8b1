"""The table of stages: a stage takes a cloud and returns a cloud. A new filter is one line here."""

from dataclasses import dataclass
from typing import Callable, Dict, Type

from node_support.parameters import ParameterSet
from sonar_processing.cloud import IntensityCloud
from sonar_processing.outliers import OutlierRemover, OutlierRemoverParameters
from sonar_processing.threshold import Thresholder, ThresholderParameters

Stage = Callable[[IntensityCloud], IntensityCloud]


@dataclass(frozen=True)
class StageType:
    """What is known of a stage before it runs. Topics are relative to the node's namespace."""

    parameters: Type[ParameterSet]
    build: Callable[[ParameterSet], Stage]
    config_name: str
    input_topic: str
    output_topic: str


STAGES: Dict[str, StageType] = {
    "thresholder": StageType(
        ThresholderParameters, Thresholder, "Thresholder", "sonar/scan/sonarCloud", "sonar/scan/thresholded"
    ),
    "outlier_remover": StageType(
        OutlierRemoverParameters,
        OutlierRemover,
        "OutlierRemover",
        "sonar/scan/thresholded",
        "sonar/scan/cleaned",
    ),
}
