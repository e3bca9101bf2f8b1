"""The chain of the thesis for map_bag: cleaned clouds are matched, with the parameters of yaml/thesis.yaml (6.5)."""

from dataclasses import dataclass
from typing import Any, Dict, Iterator, Mapping, Tuple

from mlsm_manager.offline.recording import Recording, clouds_with_odometry
from mlsm_manager.scan_matching.scan import Scan
from node_support.files import package_folder
from node_support.parameters import read_values
from sonar_processing.cloud import Cloud
from sonar_processing.filters.outliers import OutlierRemover, OutlierRemoverParameters
from sonar_processing.filters.threshold import Thresholder, ThresholderParameters
from sonar_processing.scans.assembler import ScanAssembler
from sonar_processing.scans.parameters import SonarToCloudParameters

_KINDS = {
    "sonar_to_cloud": SonarToCloudParameters, "thresholder": ThresholderParameters,
    "outlier_remover": OutlierRemoverParameters,
}  # fmt: skip


@dataclass(frozen=True)
class ThesisChain:
    """Makes scans of cleaned points."""

    clouds: SonarToCloudParameters
    threshold: ThresholderParameters
    outliers: OutlierRemoverParameters

    @classmethod
    def from_values(cls, values: Mapping[str, Any]) -> "ThesisChain":
        """Return the chain for the parameters of each node. Raises ParameterError for what a node would refuse."""
        return cls(*(kind.from_group(name, values.get(name, {})) for name, kind in _KINDS.items()))

    @property
    def stages(self) -> Dict[str, Dict[str, Any]]:
        """The parameters of the nodes behind sonar_to_cloud, by their names."""
        return {"thresholder": self.threshold.to_mapping(), "outlier_remover": self.outliers.to_mapping()}

    def scans(self, recording: Recording) -> Iterator[Tuple[Scan, int]]:
        """Yield the scans of a recording with their numbers of beams; see scans_of."""
        return clouds_with_odometry(recording, self._cleaned(recording))

    def _cleaned(self, recording: Recording) -> Iterator[Tuple[Cloud, int]]:
        assembler, threshold, remove = (
            ScanAssembler(self.clouds), Thresholder(self.threshold), OutlierRemover(self.outliers),
        )  # fmt: skip
        beams = 0
        for placed in recording.beams:
            scan, beams = assembler.add(placed), beams + 1
            if scan is not None:
                yield remove(threshold(scan)), beams
                beams = 0


def thesis_values(changes: Mapping[str, Any]) -> Dict[str, Any]:
    """Return the values of yaml/thesis.yaml by node, with `changes` by node over them."""
    values = read_values(package_folder() / "yaml/thesis.yaml")
    return {name: _over(values.get(name, {}), changes.get(name, {})) for name in {**values, **changes}}


def _over(values: Any, changes: Any) -> Any:
    if not (isinstance(values, Mapping) and isinstance(changes, Mapping)):
        return changes
    return {**values, **{key: _over(values.get(key, {}), value) for key, value in changes.items()}}
