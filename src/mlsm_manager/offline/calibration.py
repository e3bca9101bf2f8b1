"""Calibrates a sonar against the odometry of the same recording: by what its scans say about each other.

Two scans that are matched with each other tell how the vehicle moved between them, and so does the odometry. Where they
disagree in proportion to the change of the turn rate, the stamps of sonar and odometry are apart; in proportion to the
way, their scales are (as with a wrong speed of sound). Both are regressed and shrunk towards what is expected without
the recording, so that a recording that does not tell changes nothing.
"""

from dataclasses import dataclass
from typing import Collection, Iterator, List, Tuple

import numpy as np

from mlsm_manager.localisation.sensor_model import SensorModel
from mlsm_manager.matching.matchers.matcher_table import Matcher
from mlsm_manager.matching.problem.prediction import OdometryErrors
from mlsm_manager.matching.problem.result import MatchResult, Prior
from mlsm_manager.matching.problem.scan import Scan
from mlsm_manager.matching.problem.state import ERRORS, POSE
from mlsm_manager.offline.beam_width_calibration import half_width_of
from mlsm_manager.offline.replay_parameters import ReplayParameters
from mlsm_manager.surface_map.mlsm import MultiLevelSurfaceMap
from node_support.geometry.planar import wrapped
from sonar_processing.filters.echo_extraction import ExtractionMode

_DELAY_DEVIATION = 1.0
_RANGE_SCALE_DEVIATION = 0.03
_PLACE_DEVIATION = 2.5
_HEADING_DEVIATION = 0.06
_MOST_PAIRS = 40
_FEWEST_PAIRS = 8
_LAG = 6
_OUTLIER = 3.0


def calibrated(scans: List[Scan], parameters: ReplayParameters, fixed: Collection[str]) -> ReplayParameters:
    """Return `parameters` with those of the sensor model and `scale_deviation` estimated from raw `scans`.

    Those that are `fixed` stay. Only the leading edge of an echo lies beside the axis of a wide beam; its peak does
    not. Where odometry and sonar disagree by more than both may be off, `scale_deviation` is raised to match.
    """
    model = parameters.sensor_model()
    if "edge_half_width" not in fixed and parameters.mode is ExtractionMode.LEADING_EDGE:
        model = model.changed({"edge_half_width": half_width_of(scans)})
    # A fit that takes the scale of its ranges for unknown would not show it.
    comparing = parameters.changed({**model.to_mapping(), "range_scale_deviation": 0.0}).for_few_scans()
    calibrator = Calibrator(comparing.build_matcher(), parameters.part(OdometryErrors), parameters.match_resolution)
    model, scale = calibrator.calibrated(scans, model, fixed)
    if "scale_deviation" not in fixed and calibrator.contradicts(scale):
        parameters = parameters.changed({"scale_deviation": abs(scale.value)})
    return parameters.changed(model.to_mapping())


@dataclass(frozen=True)
class Estimate:
    """A value and its standard deviation, and from how many pairs of scans it came."""

    value: float
    deviation: float
    pairs: int

    def shrunk(self, expected_deviation: float) -> float:
        """Return the likeliest value where 0 with `expected_deviation` was expected beforehand."""
        if self.pairs < _FEWEST_PAIRS:
            return 0.0
        return self.value * expected_deviation**2 / (expected_deviation**2 + self.deviation**2)


@dataclass(frozen=True)
class Calibrator:
    """matcher, errors: as the run uses them. resolution: side of a cell of the one scan matched with, m."""

    matcher: Matcher
    errors: OdometryErrors
    resolution: float

    def calibrated(self, scans: List[Scan], model: SensorModel, fixed: Collection[str]) -> Tuple[SensorModel, Estimate]:
        """Return `model` with delay and scale, where they are not `fixed`, estimated from raw `scans`; and `scale`."""
        if "sonar_delay" not in fixed:
            found = self.delay([model.applied(scan) for scan in scans])
            model = model.changed({"sonar_delay": model.sonar_delay + found.shrunk(_DELAY_DEVIATION)})
        scale = self.scale([model.applied(scan) for scan in scans])
        if "range_scale" not in fixed and not self.contradicts(scale):
            model = model.changed({"range_scale": model.range_scale / (1.0 + self._share_of_sonar(scale))})
        return model, scale

    def contradicts(self, scale: Estimate) -> bool:
        """Whether a disagreement in scale is more than odometry and speed of sound can explain as they are expected."""
        expected = np.hypot(_RANGE_SCALE_DEVIATION, self.errors.scale_deviation)
        return scale.pairs >= _FEWEST_PAIRS and abs(scale.value) > _OUTLIER * float(np.hypot(expected, scale.deviation))

    def delay(self, scans: List[Scan]) -> Estimate:
        """Return by how much the sonar's stamps are early against the odometry's heading, s."""
        turns, changes = [], []
        for earlier, later, result in self._pairs(scans, 1):
            turns.append(float(wrapped(result.pose[2] - later.reference_pose[2])))
            changes.append(_turn_rate(later) - _turn_rate(earlier))
        return _regressed(np.array(changes)[:, np.newaxis], np.array(turns), 1.0)

    def scale(self, scans: List[Scan]) -> Estimate:
        """Return by what share the sonar's distances are longer than the odometry's.

        What the odometry wanders makes its ways longer than they were, which would make the sonar's seem shorter
        (errors in variables); the expected length of the wandering is taken out.
        """
        ways, found, wandered = [], [], []
        for earlier, later, result in self._pairs(scans, _LAG):
            way = later.reference_pose[:2] - earlier.reference_pose[:2]
            ways += [[way[0], -way[1]], [way[1], way[0]]]
            found += list(result.pose[:2] - later.reference_pose[:2])
            wandered.append(2.0 * self.errors.wandering(later.reference_time - earlier.reference_time))
        # Pairs that share a part of the way err together.
        together = max(_LAG / _step(scans), 1.0)
        raw = _regressed(np.array(ways).reshape(-1, 2), np.array(found), together)
        share = sum(wandered) / max(float(np.square(ways).sum()) / 2.0, 1e-9)
        return Estimate(raw.value + min(share, 1.0), raw.deviation, raw.pairs)

    def _share_of_sonar(self, found: Estimate) -> float:
        """Return what of a disagreement in scale is the sonar's, the odometry's scale being uncertain too."""
        value = found.shrunk(float(np.hypot(_RANGE_SCALE_DEVIATION, self.errors.scale_deviation)))
        return value * _RANGE_SCALE_DEVIATION**2 / (_RANGE_SCALE_DEVIATION**2 + self.errors.scale_deviation**2)

    def _pairs(self, scans: List[Scan], lag: int) -> Iterator[Tuple[Scan, Scan, MatchResult]]:
        """Yield pairs that match, with the later one's place in the earlier one's odometry."""
        for index in range(lag, len(scans), _step(scans)):
            earlier, later = scans[index - lag], scans[index]
            surfaces = MultiLevelSurfaceMap(self.resolution)
            surfaces.insert(earlier.points)
            result = self.matcher.match(later, surfaces.blocks, self._prior())
            if result.accepted:
                yield earlier, later, result

    def _prior(self) -> Prior:
        covariance = self.errors.covariance()
        covariance[POSE, POSE] = np.diag([_PLACE_DEVIATION, _PLACE_DEVIATION, _HEADING_DEVIATION]) ** 2
        covariance[ERRORS] *= 1e-3
        covariance[:, ERRORS] *= 1e-3
        return Prior(np.zeros(3), np.zeros(3), np.zeros(2), covariance)


def _step(scans: List[Scan]) -> int:
    return max(len(scans) // _MOST_PAIRS, 1)


def _turn_rate(scan: Scan) -> float:
    ends = scan.track.at(np.array([scan.start, scan.reference_time]))
    return float((ends[1, 2] - ends[0, 2]) / max(scan.reference_time - scan.start, 1e-3))


def _regressed(causes: np.ndarray, effects: np.ndarray, together: float) -> Estimate:
    """Return the first coefficient of `effects` (n,) over `causes` (n, k), without outliers.

    together: how many effects err as one.
    """
    if len(effects) < _FEWEST_PAIRS:
        return Estimate(0.0, float("inf"), 0)
    keep = np.ones(len(effects), dtype=bool)
    for _ in range(3):
        information = causes[keep].T @ causes[keep] + 1e-9 * np.eye(causes.shape[1])
        coefficients = np.linalg.solve(information, causes[keep].T @ effects[keep])
        left = effects - causes @ coefficients
        spread = max(1.4826 * float(np.median(np.abs(left[keep]))), 1e-6)
        keep = np.abs(left) < _OUTLIER * spread
    variance = together * spread**2 * np.linalg.inv(information)[0, 0]
    return Estimate(float(coefficients[0]), float(np.sqrt(variance)), int(keep.sum()))
