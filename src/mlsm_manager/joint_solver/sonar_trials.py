"""Fits of a run whose sonar sits, lies or measures otherwise than tf and its messages say."""

from dataclasses import dataclass, replace
from enum import Enum
from typing import List, Optional, Sequence, Tuple

import numpy as np

from mlsm_manager.joint_solver.batch_solver import BatchResult, QuickFit, likelihood_of
from mlsm_manager.joint_solver.live_solver import followed_anew
from mlsm_manager.joint_solver.normal_equations import YAW, State
from mlsm_manager.joint_solver.odometry_trials import fit_from, reckoned
from mlsm_manager.joint_solver.run_log import RunLog
from mlsm_manager.joint_solver.solution import Solution
from mlsm_manager.joint_solver.surface_points import SurfacePoints, slants_of
from mlsm_manager.scan_matching.scan import Scan
from node_support.errors import RefusedInput
from node_support.geometry import bearings_of, inverse, transformed

_ARM, _TILT, _FACTOR = 0.6, np.radians(14.0), np.log(1.1)  # m, rad, logarithm: less is how mounts and water are


class SonarKind(Enum):
    """What is wrong; sizes are those of what mends it."""

    ARM = "the sonar sits elsewhere"
    TILT = "the sonar is tilted"
    RANGES = "the range setting changed"


# By which kinds that hold all along are tried: far enough that echoes tell it, and less than what is named.
_STEPS = {SonarKind.ARM: 1.0, SonarKind.TILT: 0.02}
_SHARE = 0.1  # of a step, in which the likelihood changes evenly
_FARTHEST = 2.0  # steps: beyond, likelihoods are no parabolas
_LARGEST = np.log(5.0)  # of settings: more is none
_CHANGES = 4  # of ranges, that are tried
_BEFORE = 8  # scans: a run is followed anew from so many before a change on; about as many hear the same
_FEWEST = 10  # points of a scan that tell how far it hears
_STEEP = 4.0  # nats a step: with less no fault of the kind makes even a marina, which tells least, three nats likelier


@dataclass(frozen=True)
class SonarFault:
    """begin: s, of a change; NaN where it holds all along.

    sizes: m ahead and to the left; half the logarithm by which the plane is stretched ahead against aside, and along
    one diagonal against the other; or the logarithm of true ranges over reported ones.
    """

    kind: SonarKind
    begin: float
    sizes: Tuple[float, ...]

    def times(self, factor: float) -> "SonarFault":
        """Return one that is so many times as large."""
        return replace(self, sizes=tuple(factor * size for size in self.sizes))

    @property
    def text(self) -> str:
        if self.kind is SonarKind.ARM:
            ahead, aside = self.sizes
            return f"the sonar sits {ahead:+.1f} m ahead and {aside:+.1f} m to the left of where tf says"
        if self.kind is SonarKind.TILT:
            return f"the sonar's plane is tilted by about {np.degrees(self._tilt):.0f} deg against tf"
        factor = np.exp(-self.sizes[0])
        return f"the range setting changed untold: reported ranges are {factor:.2f} times the true ones"

    @property
    def _tilt(self) -> float:
        """By which a circle looks as flat, rad."""
        return float(np.arccos(np.exp(-2.0 * np.hypot(*self.sizes))))

    def is_beyond(self, _: float) -> bool:
        """Return whether it is larger than what is usual."""
        if self.kind is SonarKind.TILT:
            return self._tilt > _TILT
        return float(np.linalg.norm(self.sizes)) > (_ARM if self.kind is SonarKind.ARM else _FACTOR)

    @property
    def is_possible(self) -> bool:
        return self.kind is not SonarKind.RANGES or abs(self.sizes[0]) < _LARGEST

    def _stretch(self) -> np.ndarray:
        """(2, 2), from places as reported, from the sonar and along base_link's axes, to the true ones."""
        if self.kind is SonarKind.RANGES:
            return np.exp(self.sizes[0]) * np.eye(2)
        along, diagonal = self.sizes if self.kind is SonarKind.TILT else (0.0, 0.0)
        return np.array([[1.0 + along, diagonal], [diagonal, 1.0 - along]])

    def _wrong(self, times: np.ndarray) -> np.ndarray:
        """Return at which of `times` (n,) [s] it holds."""
        return np.isnan(self.begin) | (times >= self.begin)

    def heard(self, points: SurfacePoints) -> SurfacePoints:
        """Return points as the sonar would have heard them without it."""
        if self.kind is SonarKind.ARM:
            return points
        wrong, stretch = self._wrong(points.times), self._stretch()
        places = points.ranges[:, np.newaxis] * np.column_stack([np.cos(points.bearings), np.sin(points.bearings)])
        places[wrong] = places[wrong] @ stretch.T
        normals = points.normals.copy()
        normals[wrong] = normals[wrong] @ np.linalg.inv(stretch)
        normals /= np.hypot(*normals.T)[:, np.newaxis]
        slants = slants_of(places, normals)
        ranges, bearings = np.hypot(*places.T), bearings_of(places)
        return replace(points, ranges=ranges, bearings=bearings, normals=normals, slants=slants)

    def sonar_in_base(self, told: np.ndarray) -> np.ndarray:
        """Return where the sonar is, (2,) m, if it was `told` (2,)."""
        return told + self.sizes if self.kind is SonarKind.ARM else told

    def logged(self, log: RunLog) -> RunLog:
        """Return what the run had logged without it."""
        return log.heard_as(self.heard, self.sonar_in_base(log.sonar_in_base))

    def placed(self, scan: Scan, sonar_in_base: np.ndarray) -> Scan:
        """Return a scan as it would lie without it; sonar_in_base: (2,) m, as tf says."""
        poses, wrong = scan.track.at(scan.times), self._wrong(scan.times)
        seen = transformed(inverse(poses), scan.points)
        seen[wrong, :2] = (seen[wrong, :2] - sonar_in_base) @ self._stretch().T + self.sonar_in_base(sonar_in_base)
        return replace(scan, points=transformed(poses, seen))


def fit_without(run: Solution, fault: SonarFault, start: Optional[State] = None) -> Tuple[Solution, QuickFit]:
    """Return a run without a fault of its sonar, and its fit.

    start: where the fit begins. By default it begins at the run as it is. The path after a change of ranges may be far
    from the true one: there it begins at the odometry's path. With a compass alone it begins twice, at the run as it is
    and at the path that is found when its scans are followed anew, and the likelier fit is returned.
    """
    changed = replace(run, log=fault.logged(run.log))
    return changed, fit_from(changed, _starts(run, changed, fault) if start is None else [start])


def _starts(run: Solution, changed: Solution, fault: SonarFault) -> List[State]:
    """Return where a fit of `changed`, the run without a fault, may begin."""
    if fault.kind is not SonarKind.RANGES:
        return [run.state]
    if not np.isinf(run.parameters.odometry.distance_deviation):
        return [State(reckoned(run, changed.log, run.state.nodes, (fault.begin, np.inf)), run.state.run)]
    before = int(np.searchsorted(changed.log.node_times, fault.begin)) - _BEFORE
    try:
        return [run.state, followed_anew(changed, max(before, 0))]
    except RefusedInput:
        return [run.state]


def likelihood_across(run: Solution, fitted: State, fault: SonarFault) -> float:
    """Return how likely a run is at the state `fitted` by what scans before and after a change tell of each other.

    Scans lie closer to each other the smaller the sonar is said to hear the world, whatever is true: so only those
    count, and they are to lie closer by as much.
    """
    closer = min(float(np.exp(fault.sizes[0])), 1.0)
    parameters = replace(
        run.parameters, echo_deviation=closer * run.parameters.echo_deviation, cut=closer * run.parameters.cut
    )
    return likelihood_of(replace(run, parameters=parameters, state=fitted), fault.begin)


def ranges_changed_at(begins: Sequence[float], size: float) -> List[SonarFault]:
    """Return changes of the range setting at each of `begins` [s] by `size`, the logarithm of true ranges over reported
    ones; none where no setting is so large.
    """
    faults = [SonarFault(SonarKind.RANGES, begin, (size,)) for begin in begins]
    return [fault for fault in faults if fault.is_possible]


def changed_ranges(run: Solution) -> List[SonarFault]:
    """Return the likeliest changes of the range setting: where all around much more is heard, or less, of the range."""
    log, heard, found = run.log, [], []
    for scan in range(log.scan_count):
        points, _ = log.surfaces.heard(scan, scan + 1)
        heard.append((points.bearings + log.odometry.at(points.times)[:, YAW], np.log(points.ranges)))
    for scan, begin in enumerate((log.node_times[1:-2] + log.node_times[2:-1]) / 2.0, start=1):
        (bearings, before), (later, after) = heard[scan - 1], heard[scan + 1]
        if min(len(before), len(after)) >= _FEWEST:
            nearer = float(np.median(np.interp(later, bearings, before, period=2.0 * np.pi) - after))
            found.append(SonarFault(SonarKind.RANGES, float(begin), (nearer,)))
    possible = [fault for fault in found if fault.is_beyond(np.inf) and fault.is_possible]
    return sorted(possible, key=lambda fault: -abs(fault.sizes[0]))[:_CHANGES]


def likeliest(run: Solution, fit: BatchResult) -> List[SonarFault]:
    """Return the likeliest fault of each kind that holds all along, if the run, fitted as `fit` says, may have it.

    Its direction is that in which the run becomes likelier as it is fitted; how large it is, one more fit tells.
    """
    fitted, found = replace(run, state=fit.state), []
    for kind, step in _STEPS.items():
        slope = np.array([_slope(fitted, kind, step * axis) for axis in np.eye(2)])
        steepness = float(np.hypot(*slope))
        if steepness < _STEEP:
            continue
        unit = SonarFault(kind, np.nan, tuple((step * slope / steepness).tolist()))
        bend = steepness - (fit_without(fitted, unit)[1].log_likelihood - fit.log_likelihood)
        found.append(unit.times(min(steepness / max(2.0 * bend, steepness / _FARTHEST), _FARTHEST)))
    return found


def _slope(fitted: Solution, kind: SonarKind, step: np.ndarray) -> float:
    """Return by how many nats a run becomes likelier by `step` (2,), if it is as likely along all of it."""

    def likelihood(share: float) -> float:
        fault = SonarFault(kind, np.nan, tuple((share * step).tolist()))
        return likelihood_of(replace(fitted, log=fault.logged(fitted.log)))

    return (likelihood(_SHARE) - likelihood(-_SHARE)) / (2.0 * _SHARE)
