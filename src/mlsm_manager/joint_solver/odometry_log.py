"""What the odometry reported: over the whole run as far as it is known, and at some times."""

from dataclasses import dataclass, field
from typing import Any, Dict, Tuple

import numpy as np

from mlsm_manager.odometry.steps import seconds_untold
from mlsm_manager.scan_matching.scan import Track
from node_support.geometry import seen_from

_FIRST_CAPACITY = 256
_GROWTH = 5  # quarters: memory of a long run is dearer than copying
_WINDOW = 1.0  # s: longer than the odometry's period, short against a turn


class GrowingArray:
    """Rows of one shape and `kind`, numpy's, appended at constant cost per row.

    values: (n, ...) view of those that were appended, valid until the next change.
    """

    def __init__(self, *shape: int, kind: Any = float) -> None:
        self._rows = np.empty((_FIRST_CAPACITY, *shape), dtype=kind)
        self.values = self._rows[:0]

    def __len__(self) -> int:
        return len(self.values)

    def shorten(self, count: int) -> None:
        self.values = self.values[:count]

    def keep(self, chosen: np.ndarray) -> None:
        """Keep the chosen rows, (n,) bool, in little more memory than they need."""
        self._rows = self.values[chosen]
        self.values = self._rows[:]

    def extend(self, rows: np.ndarray) -> None:
        """Append rows (m, ...)."""
        before = len(self.values)
        count = before + len(rows)
        if count > len(self._rows):
            larger = np.empty((max(count, len(self._rows) * _GROWTH // 4), *self._rows.shape[1:]), self._rows.dtype)
            larger[:before] = self.values
            self._rows = larger
        self._rows[before:count] = rows
        self.values = self._rows[:count]


class GrowingTable:
    """Columns of equally many rows, appended at constant cost per row."""

    def __init__(self, **shapes: Tuple[int, ...]) -> None:
        """shapes: of a row of each column, by name; () for a number."""
        self._columns = {name: GrowingArray(*shape) for name, shape in shapes.items()}

    def __len__(self) -> int:
        return len(next(iter(self._columns.values())))

    def __getitem__(self, name: str) -> np.ndarray:
        """Return a column (n, ...), a view that is valid until the next change."""
        return self._columns[name].values

    def at(self, rows: np.ndarray) -> Dict[str, np.ndarray]:
        """Return `rows` (n,) int of each column, by name."""
        return {name: array.values[rows] for name, array in self._columns.items()}

    def extend(self, **rows: np.ndarray) -> None:
        """Append m rows: (m, ...) of each column."""
        for name, array in self._columns.items():
            array.extend(rows[name])

    def shorten(self, count: int) -> None:
        for array in self._columns.values():
            array.shorten(count)

    def keep(self, chosen: np.ndarray) -> None:
        """Keep the chosen rows, (n,) bool, in little more memory than they need."""
        for array in self._columns.values():
            array.keep(chosen)


@dataclass(frozen=True)
class Motion:
    """times: (m,) s. poses: (m, 3) T_odom_base. ahead: (m, 2) m, where a vehicle would be that always went ahead.

    held: (m,) s, for how long until then positions did not change at all while the heading did, or were lost: the
    odometry told nothing, or the vehicle was at rest.

    positions: (m,) complex x + i y [m] in odom.

    "Ahead" is along the reported heading, at 1 m/s since the run began: a path for an odometry that reports no other.
    """

    times: np.ndarray
    poses: np.ndarray
    ahead: np.ndarray
    held: np.ndarray
    positions: np.ndarray = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "positions", as_complex(self.poses))


class OdometryLog:
    """Poses T_odom_base of a run in the order of time; grows at its end, and yaw never jumps by a turn."""

    def __init__(self) -> None:
        self._table = GrowingTable(times=(), poses=(3,), ahead=(2,), held=())

    @classmethod
    def of(cls, track: Track) -> "OdometryLog":
        log = cls()
        log.extend(track, np.inf)
        return log

    def __len__(self) -> int:
        return len(self._table)

    def shorten(self, count: int) -> None:
        self._table.shorten(count)

    def thin(self, until: float) -> None:
        """Keep about one pose in a second of those before `until` [s]."""
        times = self._table["times"]
        seconds = np.floor(times / _WINDOW)
        self._table.keep((np.diff(seconds, prepend=-np.inf) > 0.0) | (times >= until))

    @property
    def end(self) -> float:
        """Time of the newest pose [s]; minus infinity without any."""
        return float(self._table["times"][-1]) if len(self) else -np.inf

    def extend(self, track: Track, until: float) -> None:
        """Append the poses of `track` that are newer than the newest known one and not after `until` [s]."""
        first = int(np.searchsorted(track.times, self.end, side="right"))
        last = int(np.searchsorted(track.times, until, side="right"))
        if last <= first:
            return
        times, poses = track.times[first:last], track.poses[first:last].copy()
        if len(self):
            jump = poses[0, 2] - self._table["poses"][-1, 2]
            poses[:, 2] -= 2.0 * np.pi * np.round(jump / (2.0 * np.pi))
        table = self._table
        untold = seconds_untold(table["times"], table["poses"], times, poses, track.lost[first:last])
        held = table["held"][-1:].sum() + np.cumsum(untold)
        table.extend(times=times, poses=poses, ahead=self._gone_ahead(times, poses[:, 2]), held=held)

    def _gone_ahead(self, times: np.ndarray, yaw: np.ndarray) -> np.ndarray:
        """Return where the newest (m,) poses are on the path of `Motion.ahead`, by the trapezoidal rule."""
        table, known = self._table, len(self) > 0
        start = table["ahead"][-1] if known else np.zeros(2)
        times = np.append(table["times"][-1] if known else times[0], times)
        yaw = np.append(table["poses"][-1, 2] if known else yaw[0], yaw)
        heading = np.column_stack([np.cos(yaw), np.sin(yaw)])
        steps = (heading[1:] + heading[:-1]) / 2.0 * np.diff(times)[:, np.newaxis]
        return start + np.cumsum(steps, axis=0)

    def at(self, times: np.ndarray) -> np.ndarray:
        """Return T_odom_base (..., 3) at `times` (...), linearly between the known poses; the nearest beyond them."""
        return _between(times, self._table["times"], self._table["poses"])

    def path(self, times: np.ndarray, start: float, end: float) -> Tuple[Motion, Motion]:
        """Return the motion at `times` (m,), and the known one from `start` to `end` [s] with the nearest beyond."""
        near = _around(self._table["times"], start, end)
        known = (self._table[name][near] for name in ("times", "poses", "ahead", "held"))
        return self.motion(times), Motion(*known)

    def track_from(self, start: float) -> Track:
        """Return the known poses from `start` [s] on, and the one before; for how long positions were held is lost."""
        _, known = self.path(np.array([start]), start, np.inf)
        return Track(known.times, known.poses, np.diff(known.held, prepend=known.held[0]))

    def velocity_at(self, time: float) -> np.ndarray:
        """Return the (3,) velocity in base_link, m/s, m/s, rad/s, over the second that ends at `time` [s]."""
        before, after = self.at(np.array([time - _WINDOW, time]))
        return seen_from(before, after) / _WINDOW

    def motion(self, times: np.ndarray) -> Motion:
        """Return the motion at `times` (m,), as `at` does."""
        known, held = self._table["times"], self._table["held"][:, np.newaxis]
        ahead = _between(times, known, self._table["ahead"])
        return Motion(times, self.at(times), ahead, _between(times, known, held)[..., 0])


def _between(times: np.ndarray, known: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Return values (..., c) at `times` (...) between those (n, c) at `known` (n,).

    Only what lies around `times` is touched: the cost does not grow with the run.
    """
    if times.size and len(known):
        near = _around(known, times.min(), times.max())
        known, values = known[near], values[near]
    return np.stack([np.interp(times, known, column) for column in values.T], axis=-1)


def _around(known: np.ndarray, start: float, end: float) -> slice:
    """Return which of the times `known` (n,) lie between `start` and `end`, and the nearest beyond."""
    first, last = np.searchsorted(known, [start, end])
    return slice(max(first - 1, 0), last + 2)


def as_complex(vectors: np.ndarray) -> np.ndarray:
    """Return x + i y (...) of vectors (..., >= 2)."""
    return vectors[..., 0] + 1j * vectors[..., 1]


def product(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Return the products (...) of complex numbers.

    numpy's own product rounds by where in memory the numbers lie, so that equal runs would end differently.
    """
    real = first.real * second.real - first.imag * second.imag
    return real + 1j * (first.real * second.imag + first.imag * second.real)


def stretched(path: np.ndarray, gain: np.ndarray, angle: np.ndarray) -> np.ndarray:
    """Return complex steps `path` (...) times `gain` (...), turned by `angle` (...) [rad]."""
    return product(product(gain, np.exp(1j * angle)), path)
