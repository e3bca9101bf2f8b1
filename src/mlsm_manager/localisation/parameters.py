"""Parameters of the localiser, live and on recordings, and of mlsm_core."""

from dataclasses import dataclass, fields
from enum import Enum
from typing import Any, Dict, Optional, Sequence

import numpy as np

from georeferencing.asked import AskedOrigin
from mlsm_manager.joint_solver.parameters import JointSolverParameters, SolverParameters
from mlsm_manager.localisation.joint import Assumed, Joint
from mlsm_manager.localisation.keyframe_map import MapSettings
from mlsm_manager.localisation.localiser import Localiser, LocaliserSettings, MapInput
from mlsm_manager.localisation.odometry_profiles import OdometryChoice, OdometryKind, profile_values
from mlsm_manager.localisation.thesis_estimator import ThesisEstimator
from mlsm_manager.odometry.steps import MotionLimits
from mlsm_manager.scan_matching.distribution_matcher import EVERYWHERE, NEARBY, DistributionMatcher, MatcherLimits
from mlsm_manager.scan_matching.prediction import OdometryErrors
from mlsm_manager.scan_matching.scan import Matcher
from mlsm_manager.surface_map.export.pictures import ColorBy
from mlsm_manager.surface_map.free_space import Carver, CarvingParameters
from mlsm_manager.thesis_matching.thesis_matcher import ThesisMatcher, ThesisMatcherParameters
from node_support.errors import RefusedInput
from node_support.headers import StampParameters
from node_support.parameters import ParameterError, ParameterSet, parameter
from sonar_processing.beams.parameters import beam_width_parameter

_MOST_CELLS = 16_000_000  # of 112 bytes: 1.8 GB, more than a vehicle's computer can spare


class EstimatorName(Enum):
    """How scans find their poses."""

    JOINT = "JOINT"
    THESIS = "THESIS"


@dataclass(frozen=True)
class EstimatorParameters(OdometryChoice, JointSolverParameters):
    """Which estimator finds the poses, and what the joint one needs to know."""

    estimator: EstimatorName = parameter(
        EstimatorName.JOINT,
        "JOINT: the newest scans find their poses together, none is rejected; `odometry` says what "
        "the motion is known from. THESIS: each alone, against the map of those before, as in the thesis, to compare "
        "with", tunable=False,
    )  # fmt: skip

    def check(self) -> None:
        if self.odometry is OdometryKind.NONE and self.parts_per_turn > 1:
            raise ParameterError(
                f"parts_per_turn = {self.parts_per_turn}: must be 1 with odometry = NONE, because parts of turns are "
                "placed by particles that need a heading"
            )


class MatchInput(Enum):
    """Which points are matched."""

    ECHOES = "ECHOES"
    CLEANED = "CLEANED"


@dataclass(frozen=True)
class MapParameters(ParameterSet):
    """The grids of the map, and how fast map -> odom follows a fix."""

    resolution: float = parameter(
        0.5, "side of a cell of the map that is shown and saved", unit="m", low=0.01, high=100.0, tunable=False,
        thesis_name="resolution",
    )  # fmt: skip
    match_resolution: float = parameter(
        0.5, "side of a cell of the map that scans are matched with", unit="m", low=0.01, high=100.0, tunable=False
    )
    beam_width: float = beam_width_parameter()
    map_limit: float = parameter(
        10000.0, "points farther than this from the map's origin are left out", unit="m", low=1.0, high=1e6,
        tunable=False, expert="farther away only a wrong tf puts points",
    )  # fmt: skip
    blend_time: float = parameter(1.0, "map -> odom moves to a new fix within this time", unit="s", low=0.0, high=60.0)


@dataclass(frozen=True)
class LocaliserParameters(
    ThesisMatcherParameters, EstimatorParameters, CarvingParameters, MapParameters, MotionLimits
):  # fmt: skip
    """All that a localiser is made from. What only the live node can set stands here as it is of a recording."""

    start_matching = True
    map_input = MapInput.MATCHED
    size_x_meters = size_y_meters = 0.0

    def build_localiser(self, sonar_in_base: Sequence[float] = (0.0, 0.0)) -> Localiser:
        """Return a localiser with an empty map; sonar_in_base: m, x y of the sonar in base_link."""
        settings = self.localiser_settings()
        given = self.map_settings(), self.part(OdometryErrors), settings.matcher, sonar_in_base
        if self.estimator is EstimatorName.THESIS:
            estimator = ThesisEstimator(*given)
        else:
            without_positions = None
            if self.odometry is OdometryKind.AUTO:
                other = self.changed(profile_values(OdometryKind.HEADING))
                without_positions = Assumed(other.solver_parameters(), other.part(OdometryErrors))
            estimator = Joint(*given, self.solver_parameters(), without_positions)
        estimator.matching = self.start_matching
        return Localiser(estimator, settings, self.part(MotionLimits))

    def solver_parameters(self) -> SolverParameters:
        return SolverParameters(
            **{field.name: getattr(self, field.name) for field in fields(JointSolverParameters)},
            odometry=self.odometry_model(),
            node_search=self.node_search(self.parts_per_turn),
        )

    @property
    def longest_turn(self) -> float:
        """How long a turn of the head may take [s]: in each part of it the vehicle is at about one speed."""
        measured = not np.isinf(self.odometry_model().distance_deviation)
        alone = self.estimator is not EstimatorName.JOINT
        return np.inf if measured or alone else self.rate_correlation_time * self.parts_per_turn

    def localiser_settings(self) -> LocaliserSettings:
        return LocaliserSettings(self.build_matcher(), self._searching(EVERYWHERE), self.blend_time, self.map_input)

    def build_matcher(self) -> Matcher:
        """Return what places a single scan: in JOINT only those that begin a run in a map."""
        if self.estimator is EstimatorName.THESIS:
            return ThesisMatcher(self.part(ThesisMatcherParameters))
        return self._searching(NEARBY)

    def _searching(self, limits: MatcherLimits) -> DistributionMatcher:
        return DistributionMatcher(limits, self.beam_width, self.range_scale_deviation)

    def map_settings(self) -> MapSettings:
        carver = Carver(self.part(CarvingParameters), self.beam_width) if self.carve else None
        return MapSettings(self.resolution, self.match_resolution, self.map_limit, self.expected_blocks, carver)

    @property
    def expected_blocks(self) -> int:
        return int(self.size_x_meters / self.resolution) * int(self.size_y_meters / self.resolution)


@dataclass(frozen=True)
class MlsmNodeParameters(ParameterSet):
    """What only the live node needs: inputs, frames and rates."""

    match_input: MatchInput = parameter(
        MatchInput.ECHOES, "points that are matched: sonar/scan/echoes or sonar/scan/cleaned", tunable=False
    )
    map_input: MapInput = parameter(
        MapInput.MATCHED,
        "points that make the map that is shown and saved: sonar/scan/cleaned, or those that are matched",
        tunable=False,
    )  # fmt: skip
    start_matching: bool = parameter(
        True, "match from the start; the topic startMatching turns it on and off", tunable=False
    )
    size_x_meters: float = parameter(
        120.0, "extent to reserve memory for; the map grows beyond it when it must", unit="m", low=0.0, high=100000.0,
        tunable=False, thesis_name="sizeXMeters",
        expert="the thesis's basin; reserving memory saves a pause when the map grows",
    )  # fmt: skip
    size_y_meters: float = parameter(
        50.0, "extent to reserve memory for; the map grows beyond it when it must", unit="m", low=0.0, high=100000.0,
        tunable=False, thesis_name="sizeYMeters",
        expert="the thesis's basin; reserving memory saves a pause when the map grows",
    )  # fmt: skip
    map_frame: str = parameter("map", "frame of the map", tunable=False)
    odom_frame: str = parameter("odom", "frame of the dead reckoning", tunable=False)
    base_frame: str = parameter("base_link", "frame of the vehicle, which the dead reckoning places", tunable=False)
    sonar_frame: str = parameter("sonar", "frame of the sonar, whose place on the vehicle tf knows", tunable=False)
    transform_rate: float = parameter(
        20.0, "how often map -> odom is sent", unit="1/s", low=0.1, high=1000.0, tunable=False
    )
    transform_tolerance: float = parameter(
        0.1, "how far into the future map -> odom is stamped", unit="s", low=0.0, high=10.0
    )
    map_period: float = parameter(
        1.0, "shortest time between two messages of the map, in wall time; the next change after it is sent at once",
        unit="s", low=0.05, high=3600.0, tunable=False,
    )  # fmt: skip
    color_by: ColorBy = parameter(ColorBy.TYPE, "what the colour of a block's marker tells", tunable=False)
    cloud_free: bool = parameter(
        False, "MLSM/cloud and get_region hold what is known to be free too, as blocks of type 2 (thesis 6.2.1)",
        tunable=False, expert="who takes every point for a surface must not get them",
    )  # fmt: skip
    grid_low: float = parameter(
        -1000.0, "lowest height that MLSM/grid shows", unit="m", low=-20000.0, high=20000.0, tunable=False
    )
    grid_high: float = parameter(
        1000.0, "greatest height that MLSM/grid shows", unit="m", low=-20000.0, high=20000.0, tunable=False
    )
    map_directory: str = parameter(
        "maps", "the only folder that maps are written to and loaded from; a relative path is in $ROS_HOME (~/.ros)",
        tunable=False,
    )  # fmt: skip
    map: str = parameter(
        "", "name of a map in map_directory to start with; the vehicle is searched in it", tunable=False,
        may_be_empty=True,
    )  # fmt: skip
    origin: str = parameter(
        "",
        "where the origin of a new map lies: '41.2, 3.1, azimuth 12' (of its x axis, clockwise from north; 90 where "
        "none is given), or 'fixes': as satellites tell on the topic fix; 'fixes, azimuth unknown' without a compass, "
        "'fixes, magnetic' and '41.2, 3.1, magnetic' where the compass knows no declination",
        tunable=False,
        may_be_empty=True,
    )
    autosave_period: float = parameter(
        10.0, "a changed map is saved this often, so that a node that is killed goes on in it; 0: never", unit="s",
        low=0.0, high=86400.0, tunable=False,
    )  # fmt: skip


@dataclass(frozen=True)
class MlsmCoreParameters(LocaliserParameters, MlsmNodeParameters, StampParameters):
    """All of mlsm_core's parameters, in one namespace."""

    def check(self) -> None:
        super().check()
        if self.expected_blocks > _MOST_CELLS:
            raise ParameterError(
                f"size_x_meters = {self.size_x_meters}, size_y_meters = {self.size_y_meters}: at resolution "
                f"{self.resolution} must make at most {_MOST_CELLS} cells"
            )
        try:
            self.asked_origin  # noqa: B018 - validated by reading it
        except RefusedInput as refused:
            raise ParameterError(f"origin = {refused}") from None
        if self.map_frame == self.odom_frame:
            raise ParameterError(f"map_frame = {self.map_frame!r}: must differ from odom_frame")

    @property
    def asked_origin(self) -> Optional[AskedOrigin]:
        """What is said of where the map lies; None where nothing is."""
        return AskedOrigin.parsed(self.origin) if self.origin else None

    @property
    def calibration(self) -> Dict[str, Any]:
        """The parameters that a map's blocks depend on, by name, to be stored with it."""
        values = self.to_mapping()
        return {name: values[name] for name in ("map_input", "match_input", "beam_width", "range_scale_deviation")}
