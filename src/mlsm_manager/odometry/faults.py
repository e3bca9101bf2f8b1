"""What may be wrong with an odometry: a compass that drifts, steps or errs by the heading, distances that change."""

from dataclasses import dataclass, replace
from enum import Enum
from typing import Callable, Dict, List, Tuple

import numpy as np

from mlsm_manager.scan_matching.scan import Track
from node_support.geometry import harmonics, rotated, seen_from

# rad and relative: a marina's unbroken compass errs by 3 degrees with the heading, a DVL by three times 1 percent.
_USUAL_HEADING, _USUAL_LENGTH = np.radians(4.0), 0.04
_LONGEST = np.log(5.0)  # reported over true distances: of a vehicle that seems to stand all scans lie on each other
_DAMPING = 1.0  # nodes' worth against harmonics that the headings of a run do not tell apart
_SIDE = 0.15  # of the run, at both ends, in which nothing tells a change from what holds all along


class FaultKind(Enum):
    """What is wrong; sizes are those of what has to be added to the heading, or the factor of distances."""

    DRIFT = "the compass drifts"
    STEP = "the compass stepped"
    SLIP = "the head slipped"
    SLIPS_ON = "the head slips all the time"
    CIRCLE = "the compass errs by the heading"
    LENGTH = "all reported distances are wrong"
    DISTANCES = "reported distances changed"
    CARRIED = "a current carried the vehicle, and the odometry did not feel it"
    STUCK = "the compass stuck"
    RIGHT = "the compass stepped beside positions that are right"
    FOLLOWED = "positions followed a step of the compass"
    LATER = "the delay of the beams changed"
    EVER_LATER = "the delay of the beams grows"


OF_DISTANCES = (FaultKind.LENGTH, FaultKind.DISTANCES)
# That pairs of scans or headings show.
TURNED = (FaultKind.RIGHT, FaultKind.FOLLOWED)  # of positions, from a step of the compass on that was left out
OF_STAMPS = (FaultKind.LATER, FaultKind.EVER_LATER)
_SEEN = (FaultKind.SLIP, FaultKind.CARRIED, FaultKind.STUCK, *TURNED, *OF_STAMPS)
OF_HEAD = (FaultKind.SLIP, FaultKind.SLIPS_ON)
_GROWING = (FaultKind.DRIFT, FaultKind.SLIPS_ON, FaultKind.EVER_LATER)
_ALL_ALONG = (FaultKind.LENGTH, FaultKind.CIRCLE)


@dataclass(frozen=True)
class MotionFault:
    """begin: s, of a drift, a step or a change; NaN where it holds all along.

    sizes: (k,) of what mends it: rad/s; rad; rad, times cosine and sine of the heading and of twice the heading; the
    logarithm of a factor; x y [m/s] in odom; or s, or s in each second, by which beams are later than before. end: s,
    of a current, or of a heading that stuck. After a step of the compass that was left out positions that were right go
    astray, or those that followed where it was left out of the headings alone: it is they that are turned.
    """

    kind: FaultKind
    begin: float
    sizes: Tuple[float, ...]
    end: float = np.inf

    def times(self, factor: float) -> "MotionFault":
        """Return one that is so many times as large."""
        return replace(self, sizes=tuple(factor * size for size in self.sizes))

    @property
    def text(self) -> str:
        size = float(np.linalg.norm(self.sizes))
        if self.kind is FaultKind.STUCK:
            missed = f" and missed {np.degrees(self.sizes[0]):.0f} deg," if size else ""
            return f"the compass stuck for {self.end - self.begin:.0f} s{missed}"
        if self.kind in OF_DISTANCES:
            factor = float(np.exp(-self.sizes[0]))
            ranges = f", or reported ranges {1.0 / factor:.2f} times" if self.kind is FaultKind.LENGTH else ""
            return f"reported distances are {factor:.2f} times the true ones{ranges}"
        if self.kind in OF_STAMPS:
            side = "later" if self.sizes[0] > 0.0 else "earlier"
            ever = f"ever {side}, by {60.0 * size:.1f} s more in each minute"
            changed = ever if self.kind in _GROWING else f"{size:.1f} s {side} than before"
            return f"beams were sent {changed}, by the odometry's clock,"
        if self.kind in _GROWING:
            rate = f"by {-60.0 * np.degrees(self.sizes[0]):+.1f} deg per minute"
            slips = f"the head slipped {rate}, or the compass drifts beside positions that are right,"
            return slips if self.kind is FaultKind.SLIPS_ON else f"the compass drifts {rate}"
        if self.kind is FaultKind.RIGHT:
            return f"the compass stepped by {np.degrees(self.sizes[0]):.0f} deg beside positions that are right,"
        if self.kind is FaultKind.FOLLOWED:
            return f"positions followed the compass, which stepped by {-np.degrees(self.sizes[0]):.0f} deg,"
        if self.kind in (FaultKind.STEP, FaultKind.SLIP):
            return f"the head slipped by {abs(np.degrees(self.sizes[0])):.0f} deg, or the compass stepped,"
        if self.kind is FaultKind.CARRIED:
            way, seconds = size * (self.end - self.begin), self.end - self.begin
            return f"the vehicle was carried by {way:.0f} m in {seconds:.0f} s, which the odometry did not feel,"
        return f"the compass errs by up to {np.degrees(size):.0f} deg by the heading: iron beside it"

    def is_beyond(self, end: float) -> bool:
        """Return whether it is larger, by `end` [s], than errors of a compass and a DVL that are as they should be."""
        if self.kind in (FaultKind.CARRIED, FaultKind.STUCK, *TURNED, *OF_STAMPS):
            return True
        size = float(np.linalg.norm(self.sizes)) * (end - self.begin if self.kind in _GROWING else 1.0)
        return size > (_USUAL_LENGTH if self.kind in OF_DISTANCES else _USUAL_HEADING)

    @property
    def is_possible(self) -> bool:
        return self.kind not in OF_DISTANCES or self.sizes[0] > -_LONGEST

    def mended(self, track: Track) -> Track:
        """Return T_odom_base without the fault; positions are reckoned anew, as the vehicle did from its heading.

        After a slip of the head the heading is that of the sonar.
        """
        if self.kind is FaultKind.CARRIED:
            since = np.clip(track.times - self.begin, 0.0, self.end - self.begin)
            return track.with_poses(track.poses + since[:, np.newaxis] * np.append(self.sizes, 0.0))
        if self.kind in TURNED:
            return with_positions_turned(track, self.sizes[0], self.begin)
        errors = self._errors(track)
        if self.kind in OF_STAMPS:
            return track.with_poses(track.at(track.times + errors))
        steps = seen_from(track.poses[:-1], track.poses[1:])
        if self.kind in OF_DISTANCES:
            steps[:, :2] *= np.exp(errors[1:, np.newaxis])
            return track.with_poses(integrated(track.poses[0], steps))
        yaws = track.poses[:, 2] + errors
        if self.kind in OF_HEAD:
            return track.with_poses(np.column_stack([track.poses[:, :2], yaws]))
        steps[:, 2] = np.diff(yaws)
        return track.with_poses(integrated(np.append(track.poses[0, :2], yaws[0]), steps))

    def _errors(self, track: Track) -> np.ndarray:
        """Return what mends the logarithms of distances, or the headings [rad], (m,). Stuck headings turn evenly."""
        if self.kind is FaultKind.STUCK:
            return self.sizes[0] * np.clip((track.times - self.begin) / (self.end - self.begin), 0.0, 1.0)
        return _COLUMNS[self.kind](track.times, track.poses[:, 2], self.begin) @ np.array(self.sizes)


def integrated(start: np.ndarray, steps: np.ndarray) -> np.ndarray:
    """Return poses (m, 3) from `start` (3,) on by `steps` (m - 1, 3), each in the vehicle's frame."""
    yaws = start[2] + np.append(0.0, np.cumsum(steps[:, 2]))
    moves = (steps[:, 0] + 1j * steps[:, 1]) * np.exp(1j * yaws[:-1])
    places = complex(*start[:2]) + np.append(0.0, np.cumsum(moves))
    return np.column_stack([places.real, places.imag, yaws])


class Mirror(Enum):
    """Of what y counts the other way: of positions in odom, or of moves in the vehicle's frame."""

    NOTHING = "nothing"
    POSITIONS = "positions"
    MOVES = "moves"

    def of(self, track: Track) -> Track:
        """Return a track without it, or with it; it begins where it began, and headings stay."""
        if self is Mirror.NOTHING:
            return track
        start, signs = track.poses[0], np.array([1.0, -1.0, 1.0])
        if self is Mirror.MOVES:
            return track.with_poses(integrated(start, signs * seen_from(track.poses[:-1], track.poses[1:])))
        return track.with_poses(np.append(start[:2], 0.0) + signs * (track.poses - np.append(start[:2], 0.0)))


def with_positions_turned(track: Track, turn: float, begin: float = -np.inf) -> Track:
    """Return a track whose positions are turned by `turn` [rad] about that at `begin` [s]; headings stay, and what was
    before.
    """
    start = track.at(max(begin, track.times[0]))[:2]
    gone = rotated(track.poses[:, :2] - start, np.where(track.times >= begin, turn, 0.0))
    return track.with_poses(np.column_stack([start + gone, track.poses[:, 2]]))


def with_headings_reversed(track: Track, are_reckoned: bool) -> Track:
    """Return a track whose headings count the other way; are_reckoned: positions follow from moves and headings."""
    poses = track.poses * [1.0, 1.0, -1.0]
    if not are_reckoned:
        return track.with_poses(poses)
    steps = seen_from(track.poses[:-1], track.poses[1:]) * [1.0, 1.0, -1.0]
    return track.with_poses(integrated(poses[0], steps))


def _since(times: np.ndarray, _: np.ndarray, begin: float) -> np.ndarray:
    return np.maximum(times - begin, 0.0)[:, np.newaxis]


def _after(times: np.ndarray, _: np.ndarray, begin: float) -> np.ndarray:
    return (times > begin).astype(float)[:, np.newaxis]


_COLUMNS: Dict[FaultKind, Callable[[np.ndarray, np.ndarray, float], np.ndarray]] = {
    FaultKind.DRIFT: _since,
    FaultKind.STEP: _after,
    FaultKind.SLIP: _after,
    FaultKind.SLIPS_ON: _since,
    FaultKind.LENGTH: lambda times, _, __: np.ones((len(times), 1)),
    FaultKind.DISTANCES: _after,
    FaultKind.LATER: _after,
    FaultKind.EVER_LATER: _since,
    FaultKind.CIRCLE: lambda _, yaws, __: harmonics(yaws),
}
"""Of each kind what one unit of its sizes adds to headings (m,) reported at `times` (m,), (m, k)."""


def likely_faults(times: np.ndarray, yaws: np.ndarray, headings: np.ndarray, scales: np.ndarray) -> List[MotionFault]:
    """Return the fault of each kind that explains most of what an odometry was wrong by. Needs the past only.

    times: (n,) s. yaws: (n,) rad, as reported. headings: (n,) rad, what a fit that lets the odometry err added to
    these. scales: (n,) true distances over those that the run found, minus 1, by the same fit.
    """
    logs, found = np.log1p(np.maximum(scales, -0.9)), []
    for kind in FaultKind:
        if kind in _SEEN:
            continue
        values = logs if kind in OF_DISTANCES else headings
        tried = [_explained(kind, times, yaws, values, float(begin)) for begin in _begins(times, kind)]
        found.append(min(tried, key=lambda one: one[0])[1])
    return found


def _begins(times: np.ndarray, kind: FaultKind) -> np.ndarray:
    if kind in _ALL_ALONG:
        return np.array([np.nan])
    first, last = np.quantile(times, [0.0 if kind in _GROWING else _SIDE, 1.0 - _SIDE])
    return times[(times >= first) & (times <= last)]


def _explained(
    kind: FaultKind, times: np.ndarray, yaws: np.ndarray, values: np.ndarray, begin: float
) -> Tuple[float, MotionFault]:
    """Return what is left of values (n,), and the fault; besides it a value that holds all along is no fault."""
    columns = _COLUMNS[kind](times, yaws, begin)
    count = columns.shape[1]
    if kind is not FaultKind.LENGTH:
        columns = np.column_stack([columns, np.ones(len(times))])
    damping = np.diag(np.full(columns.shape[1], _DAMPING if kind is FaultKind.CIRCLE else 0.0))
    sizes = np.linalg.solve(columns.T @ columns + damping, columns.T @ values)
    left = float(((values - columns @ sizes) ** 2).sum())
    return left, MotionFault(kind, begin, tuple(sizes[:count].tolist()))
