"""What may be wrong with an odometry: a compass that drifts, steps or errs by the heading, distances that change."""

from dataclasses import dataclass, replace
from enum import Enum, auto
from typing import Callable, Dict, List, NamedTuple, Optional, Tuple

import numpy as np

from mlsm_manager.odometry.changed_tracks import integrated, with_positions_turned
from mlsm_manager.scan_matching.scan import Track
from node_support.geometry import harmonics, seen_from

# rad and relative: a marina's unbroken compass errs by 3 degrees with the heading, a DVL by three times 1 percent.
_USUAL_HEADING, _USUAL_LENGTH = np.radians(4.0), 0.04
_LONGEST = np.log(5.0)  # reported over true distances: of a vehicle that seems to stand all scans lie on each other
_DAMPING = 1.0  # nodes' worth against harmonics that the headings of a run do not tell apart
_SIDE = 0.15  # of the run, at both ends, in which nothing tells a change from what holds all along


class FaultKind(Enum):
    """What is wrong; `_KINDS` says how each is told and mended, and what its sizes are."""

    DRIFT = auto()
    STEP = auto()
    SLIP = auto()
    SLIPS_ON = auto()
    CIRCLE = auto()
    LENGTH = auto()
    DISTANCES = auto()
    CARRIED = auto()
    STUCK = auto()
    STEP_ALONE = auto()
    STEP_FOLLOWED = auto()
    LATER = auto()
    EVER_LATER = auto()


OF_DISTANCES = (FaultKind.LENGTH, FaultKind.DISTANCES)
TURNED = (FaultKind.STEP_ALONE, FaultKind.STEP_FOLLOWED)  # of positions, after a step of the compass that was left out
OF_STAMPS = (FaultKind.LATER, FaultKind.EVER_LATER)
# That a fit shows which lets the odometry err; others are shown by pairs of scans or by headings.
_OF_FITS = (
    FaultKind.DRIFT, FaultKind.STEP, FaultKind.SLIPS_ON, FaultKind.CIRCLE, FaultKind.LENGTH, FaultKind.DISTANCES,
)  # fmt: skip


@dataclass(frozen=True)
class MotionFault:
    """begin: s, of a drift, a step or a change; NaN where it holds all along. end: s, of what ends.

    sizes: (k,) of what mends it; `_KINDS` says of what.
    """

    kind: FaultKind
    begin: float
    sizes: Tuple[float, ...]
    end: float = np.inf

    def times(self, factor: float) -> "MotionFault":
        """Return one that is so many times as large."""
        return replace(self, sizes=tuple(factor * size for size in self.sizes))

    @property
    def size(self) -> float:
        return float(np.linalg.norm(self.sizes))

    @property
    def degrees(self) -> float:
        """The size of one that is an angle, in degrees; of what grows, in a second."""
        return float(np.degrees(self.sizes[0]))

    @property
    def seconds(self) -> float:
        """How long it lasts, s."""
        return self.end - self.begin

    @property
    def text(self) -> str:
        return _KINDS[self.kind].text(self)

    def is_beyond(self, end: float) -> bool:
        """Return whether it is larger, by `end` [s], than errors of a compass and a DVL that are as they should be."""
        kind = _KINDS[self.kind]
        return not kind.usual or self.size * (end - self.begin if kind.grows else 1.0) > kind.usual

    @property
    def is_possible(self) -> bool:
        return self.kind not in OF_DISTANCES or self.sizes[0] > -_LONGEST

    def mended(self, track: Track) -> Track:
        """Return T_odom_base without the fault; positions are reckoned anew, as the vehicle did from its heading."""
        return _KINDS[self.kind].mended(self, track)

    def errors(self, track: Track) -> np.ndarray:
        """Return what mends headings [rad], logarithms of distances or stamps [s] at the times of a track, (m,)."""
        return _KINDS[self.kind].columns(track.times, track.poses[:, 2], self.begin) @ np.array(self.sizes)


Columns = Callable[[np.ndarray, np.ndarray, float], np.ndarray]
"""Gives what one unit of each size adds to headings (m,) reported at `times` (m,), (m, k), by the fault's beginning."""


def _since(times: np.ndarray, _: np.ndarray, begin: float) -> np.ndarray:
    return np.maximum(times - begin, 0.0)[:, np.newaxis]


def _after(times: np.ndarray, _: np.ndarray, begin: float) -> np.ndarray:
    return (times > begin).astype(float)[:, np.newaxis]


def _always(times: np.ndarray, _: np.ndarray, __: float) -> np.ndarray:
    return np.ones((len(times), 1))


def _by_heading(_: np.ndarray, yaws: np.ndarray, __: float) -> np.ndarray:
    return harmonics(yaws)


def _headings_mended(fault: MotionFault, track: Track) -> Track:
    return _reckoned_anew(track, fault.errors(track))


def _head_mended(fault: MotionFault, track: Track) -> Track:
    """The heading is that of the sonar after it; positions stay."""
    return track.with_poses(np.column_stack([track.poses[:, :2], track.poses[:, 2] + fault.errors(track)]))


def _distances_mended(fault: MotionFault, track: Track) -> Track:
    steps = seen_from(track.poses[:-1], track.poses[1:])
    steps[:, :2] *= np.exp(fault.errors(track)[1:, np.newaxis])
    return track.with_poses(integrated(track.poses[0], steps))


def _current_mended(fault: MotionFault, track: Track) -> Track:
    since = np.clip(track.times - fault.begin, 0.0, fault.seconds)
    return track.with_poses(track.poses + since[:, np.newaxis] * np.append(fault.sizes, 0.0))


def _stuck_mended(fault: MotionFault, track: Track) -> Track:
    """Headings that stuck turn evenly instead."""
    return _reckoned_anew(track, fault.sizes[0] * np.clip((track.times - fault.begin) / fault.seconds, 0.0, 1.0))


def _positions_mended(fault: MotionFault, track: Track) -> Track:
    return with_positions_turned(track, fault.sizes[0], fault.begin)


def _stamps_mended(fault: MotionFault, track: Track) -> Track:
    return track.with_poses(track.at(track.times + fault.errors(track)))


def _reckoned_anew(track: Track, turns: np.ndarray) -> Track:
    """Return a track whose headings are turned by `turns` (m,) [rad]; positions follow from steps and headings."""
    steps = seen_from(track.poses[:-1], track.poses[1:])
    yaws = track.poses[:, 2] + turns
    steps[:, 2] = np.diff(yaws)
    return track.with_poses(integrated(np.append(track.poses[0, :2], yaws[0]), steps))


def _slip_text(fault: MotionFault) -> str:
    return f"the head slipped by {abs(fault.degrees):.0f} deg, or the compass stepped,"


def _distances_text(fault: MotionFault) -> str:
    return f"reported distances are {np.exp(-fault.sizes[0]):.2f} times the true ones"


def _length_text(fault: MotionFault) -> str:
    return f"{_distances_text(fault)}, or reported ranges {np.exp(fault.sizes[0]):.2f} times"


def _current_text(fault: MotionFault) -> str:
    way = f"{fault.size * fault.seconds:.0f} m in {fault.seconds:.0f} s"
    return f"the vehicle was carried by {way}, which the odometry did not feel,"


def _stuck_text(fault: MotionFault) -> str:
    missed = f" and missed {fault.degrees:.0f} deg," if fault.size else ""
    return f"the compass stuck for {fault.seconds:.0f} s{missed}"


def _stamps_text(fault: MotionFault) -> str:
    return f"beams were sent {fault.size:.1f} s {_side(fault)} than before, by the odometry's clock,"


def _growing_stamps_text(fault: MotionFault) -> str:
    more = f"by {60.0 * fault.size:.1f} s more in each minute"
    return f"beams were sent ever {_side(fault)}, {more}, by the odometry's clock,"


def _side(fault: MotionFault) -> str:
    return "later" if fault.sizes[0] > 0.0 else "earlier"


class _Kind(NamedTuple):
    """What there is to know of a kind of faults. columns: see `Columns`; None where a fault adds nothing such.

    usual: no size that is smaller is a fault.
    """

    text: Callable[[MotionFault], str]
    mended: Callable[[MotionFault, Track], Track]
    columns: Optional[Columns] = None
    usual: float = 0.0

    @property
    def grows(self) -> bool:
        return self.columns is _since

    @property
    def has_begin(self) -> bool:
        return self.columns in (_since, _after)


_KINDS: Dict[FaultKind, _Kind] = {
    # rad/s, added to the heading
    FaultKind.DRIFT: _Kind(
        lambda fault: f"the compass drifts by {-60.0 * fault.degrees:+.1f} deg per minute",
        _headings_mended, _since, _USUAL_HEADING,
    ),
    FaultKind.SLIPS_ON: _Kind(
        lambda fault: (
            f"the head slipped by {-60.0 * fault.degrees:+.1f} deg per minute, "
            "or the compass drifts beside positions that are right,"
        ),
        _head_mended, _since, _USUAL_HEADING,
    ),
    # rad, added to the heading; of a circle times cosine and sine of the heading and of twice the heading
    FaultKind.STEP: _Kind(_slip_text, _headings_mended, _after, _USUAL_HEADING),
    FaultKind.SLIP: _Kind(_slip_text, _head_mended, _after, _USUAL_HEADING),
    FaultKind.CIRCLE: _Kind(
        lambda fault: f"the compass errs by up to {np.degrees(fault.size):.0f} deg by the heading: iron beside it",
        _headings_mended, _by_heading, _USUAL_HEADING,
    ),
    FaultKind.STUCK: _Kind(_stuck_text, _stuck_mended),
    # rad: after a step of the compass that was left out, positions that were right go astray, or those that followed
    # where it was left out of the headings alone; it is they that are turned
    FaultKind.STEP_ALONE: _Kind(
        lambda fault: f"the compass stepped by {fault.degrees:.0f} deg beside positions that are right,",
        _positions_mended,
    ),
    FaultKind.STEP_FOLLOWED: _Kind(
        lambda fault: f"positions followed the compass, which stepped by {-fault.degrees:.0f} deg,",
        _positions_mended,
    ),
    # the logarithm of a factor
    FaultKind.LENGTH: _Kind(_length_text, _distances_mended, _always, _USUAL_LENGTH),
    FaultKind.DISTANCES: _Kind(_distances_text, _distances_mended, _after, _USUAL_LENGTH),
    # x and y, m/s in odom
    FaultKind.CARRIED: _Kind(_current_text, _current_mended),
    # s, or s in each second, by which beams are later than before
    FaultKind.LATER: _Kind(_stamps_text, _stamps_mended, _after),
    FaultKind.EVER_LATER: _Kind(_growing_stamps_text, _stamps_mended, _since),
}  # fmt: skip


def likely_faults(times: np.ndarray, yaws: np.ndarray, headings: np.ndarray, scales: np.ndarray) -> List[MotionFault]:
    """Return the fault of each kind that explains most of what an odometry was wrong by. Needs the past only.

    times: (n,) s. yaws: (n,) rad, as reported. headings: (n,) rad, what a fit that lets the odometry err added to
    these. scales: (n,) true distances over those that the run found, minus 1, by the same fit.
    """
    logs, found = np.log1p(np.maximum(scales, -0.9)), []
    for kind in _OF_FITS:
        values = logs if kind in OF_DISTANCES else headings
        tried = [_explained(kind, times, yaws, values, float(begin)) for begin in _begins(times, kind)]
        found.append(min(tried, key=lambda one: one[0])[1])
    return found


def _begins(times: np.ndarray, kind: FaultKind) -> np.ndarray:
    if not _KINDS[kind].has_begin:
        return np.array([np.nan])
    first, last = np.quantile(times, [0.0 if _KINDS[kind].grows else _SIDE, 1.0 - _SIDE])
    return times[(times >= first) & (times <= last)]


def _explained(
    kind: FaultKind, times: np.ndarray, yaws: np.ndarray, values: np.ndarray, begin: float
) -> Tuple[float, MotionFault]:
    """Return what is left of values (n,), and the fault; besides it a value that holds all along is no fault."""
    columns = _KINDS[kind].columns(times, yaws, begin)
    count = columns.shape[1]
    if kind is not FaultKind.LENGTH:
        columns = np.column_stack([columns, np.ones(len(times))])
    damping = np.diag(np.full(columns.shape[1], _DAMPING if kind is FaultKind.CIRCLE else 0.0))
    sizes = np.linalg.solve(columns.T @ columns + damping, columns.T @ values)
    left = float(((values - columns @ sizes) ** 2).sum())
    return left, MotionFault(kind, begin, tuple(sizes[:count].tolist()))
