"""Parameters of map_bag, and live.yaml: those with which the live nodes do what map_bag did."""

from dataclasses import dataclass, fields, replace
from typing import Any, Dict, List, Mapping, Optional, Tuple, Type

import yaml

from mlsm_manager.joint_solver.parameters import SolverParameters
from mlsm_manager.localisation.parameters import LocaliserParameters, MapInput, MatchInput, MlsmCoreParameters
from mlsm_manager.offline.thesis_chain import ThesisChain
from node_support.node_table import NODES as LIVE_NODES
from node_support.parameters import ParameterSet, with_defaults
from recordings.reader import ReadingParameters
from sonar_processing.beams.parameters import BeamCorrection
from sonar_processing.filters.echo_extractor import EchoExtractorParameters
from sonar_processing.scans.parameters import SonarToCloudParameters

_ALL = 10**9  # scans


@dataclass(frozen=True)
@with_defaults(pulse_sigma=0.0, threshold_share=0.5, min_height=2.0)
class ReplayParameters(LocaliserParameters, ReadingParameters, BeamCorrection, EchoExtractorParameters):
    """All that --set may change, with the defaults of the live nodes, but for weak and wide echoes.

    These suit recordings of real heads. Live, a compass alone lost its way with them in the simulated harbour.
    """

    def echoes(self) -> EchoExtractorParameters:
        """Return how echoes are found."""
        return self.part(EchoExtractorParameters)

    def solver_parameters(self) -> SolverParameters:
        """Return what these mean for the joint solver, which keeps all scans: `--refine` fits the whole run."""
        return replace(super().solver_parameters(), kept_scans=_ALL)


NODES: Dict[str, Type[ParameterSet]] = {
    "sonar_to_cloud": SonarToCloudParameters,
    "echo_extractor": EchoExtractorParameters,
    "mlsm_core": MlsmCoreParameters,
}


@dataclass(frozen=True)
class _CloudParameters(ReadingParameters, BeamCorrection):
    """What sonar_to_cloud and a replay know by the same name and meaning."""


_SHARED: Dict[str, Type[ParameterSet]] = {**NODES, "sonar_to_cloud": _CloudParameters}
_COMMENT = "# Written by map_bag. mapping.launch, vehicle.launch and play_bag.launch take it as parameters:=FILE.\n"


def live_values(
    parameters: ReplayParameters, odom_frame: str, base_frame: str, chain: Optional[ThesisChain] = None
) -> Dict[str, Dict[str, Any]]:
    """Return for each node the parameters with which it does what a replay with `parameters` did.

    chain: what made the scans, where they are not echoes.
    """
    values = {name: _common(parameters.to_mapping(), name) for name in NODES}
    cloud = SonarToCloudParameters(target_frame=odom_frame)
    values["sonar_to_cloud"].update(
        target_frame=cloud.target_frame, min_range=cloud.min_range, height_limit=cloud.height_limit
    )
    if chain is not None:
        values["sonar_to_cloud"] = {**chain.clouds.to_mapping(), **_common(parameters.to_mapping(), "sonar_to_cloud")}
        values["sonar_to_cloud"].update(target_frame=odom_frame)
    values["mlsm_core"].update(
        size_x_meters=0.0,
        size_y_meters=0.0,
        map_frame="map" if odom_frame != "map" else "corrected_map",
        odom_frame=odom_frame,
        base_frame=base_frame,
        match_input=(MatchInput.ECHOES if chain is None else MatchInput.CLEANED).value,
        map_input=MapInput.MATCHED.value,
        start_matching=True,
    )
    stages = {} if chain is None else chain.stages
    return {**{name: NODES[name].nested(own) for name, own in values.items()}, **stages}


def replay_values(values: Mapping[str, Any]) -> Tuple[Dict[str, Any], List[str]]:
    """Return values by the names of ReplayParameters, and a remark on each key of an older version.

    values: may hold some of them by node, as live.yaml does. Keys of the live nodes that a replay does not know are
    left out, and nodes of which a replay knows nothing. Raises ParameterError for what a node would refuse.
    """
    plain = {key: value for key, value in values.items() if key not in LIVE_NODES}
    found, remarks = ReplayParameters.by_name(plain)
    for name in NODES:
        if name in values:
            NODES[name].from_group(name, values[name])
            own, told = NODES[name].by_name(values[name])
            found.update(_common(own, name))
            remarks += told
    return found, remarks


def live_text(
    parameters: ReplayParameters, odom_frame: str, base_frame: str, chain: Optional[ThesisChain] = None
) -> str:
    """Return the text of live.yaml."""
    values = live_values(parameters, odom_frame, base_frame, chain)
    return _COMMENT + yaml.safe_dump(values, sort_keys=False, allow_unicode=True)


def _common(values: Mapping[str, Any], node: str) -> Dict[str, Any]:
    """Return those of `values` that both the node and a replay know by the same name and meaning."""
    replayed = {field.name for field in fields(ReplayParameters)}
    names = [field.name for field in fields(_SHARED[node]) if field.name in replayed]
    return {name: values[name] for name in names if name in values}
