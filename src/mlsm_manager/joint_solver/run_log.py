"""What was measured during a run: surface points of every scan, the nodes' times, the odometry; and its storing."""

from dataclasses import fields, is_dataclass, replace
from typing import Any, Callable, Dict, Iterator, List, Mapping, Optional, Sequence, Tuple

import numpy as np

from mlsm_manager.joint_solver.odometry_log import GrowingArray, GrowingTable, Motion, OdometryLog
from mlsm_manager.joint_solver.surface_points import Sights, SurfacePoints, post_points
from mlsm_manager.scan_matching.scan import Scan
from node_support.errors import RefusedInput
from node_support.geometry import members

_SHORTEST_SCAN = 1.0  # s: a first scan without points still needs a beginning before its end
_POINTS_OF_PLATEAU = 2.0  # per echo: plateaus have 3 to 4 at a spacing of 1 m, peaks 1.0 to 1.3


_OF_POINTS = [field.name for field in fields(SurfacePoints)]
# Of a scan: number of poses of the odometry before it, its points and echoes, and whether its points are forgotten.
_SCAN = [("odometry", int), ("points", int), ("echoes", float), ("forgotten", bool)]


class PointTable:
    """The points of scans 0, 1, ... in the order of time."""

    def __init__(self) -> None:
        self._starts = GrowingArray(kind=np.int64)
        self._starts.extend([0])
        self._table = GrowingTable(**{name: (2,) if name == "normals" else () for name in (*_OF_POINTS, "scans")})

    @property
    def scan_count(self) -> int:
        return len(self._starts.values) - 1

    @property
    def counts(self) -> np.ndarray:
        """(scan_count,) int, number of points of each scan."""
        return np.diff(self._starts.values)

    def append(self, points: SurfacePoints) -> None:
        count = len(points.times)
        self._table.extend(**vars(points), scans=np.full(count, self.scan_count))
        self._starts.extend([self._starts.values[-1] + count])

    def since(self, scan: int, change: Optional[Callable[[SurfacePoints], SurfacePoints]] = None) -> "PointTable":
        """Return a table of what `change` makes of `scan` and all later ones, the first of which is number 0 there."""
        later = PointTable()
        for number in range(scan, self.scan_count):
            points, _ = self.heard(number, number + 1)
            later.append(change(points) if change else points)
        return later

    def shorten(self, scans: int) -> None:
        self._starts.shorten(scans + 1)
        self._table.shorten(self._starts.values[-1])

    def forget(self, scans: np.ndarray) -> None:
        """Forget the points of `scans` (n,) bool, one for each scan so far."""
        counts = self.counts
        self._table.keep(np.repeat(~scans, counts))
        self._starts.values[1:] = np.cumsum(np.where(scans, 0, counts))

    def rows(self, first: int, last: int) -> np.ndarray:
        """Return the rows (n,) of the points of scans `first` to `last` - 1, oldest scan first."""
        return np.arange(self._starts.values[first], self._starts.values[last])

    def rows_of(self, scans: np.ndarray) -> Tuple[np.ndarray, np.ndarray]:
        """Return the rows (n,) of the points of `scans` (s,) int, one scan after the other, and how many (s,)."""
        starts, ends = self._starts.values[scans], self._starts.values[scans + 1]
        counts = ends - starts
        scan, number = members(counts)
        return starts[scan] + number, counts

    def points(self, rows: np.ndarray) -> Tuple[SurfacePoints, np.ndarray]:
        """Return the points in `rows` (n,) int, and the scan (n,) int of each."""
        columns = self._table.at(rows)
        scans = columns.pop("scans").astype(np.int64)
        return SurfacePoints(**columns), scans

    def heard(self, first: int, last: int) -> Tuple[SurfacePoints, np.ndarray]:
        """Return the points of scans `first` to `last` - 1, oldest scan first, and the scan (n,) int of each."""
        return self.points(self.rows(first, last))


class RunLog:
    """Scan k lies between nodes k and k + 1; node k + 1 is at the time of the scan's last beam.

    sonar_in_base: (2,) m. surfaces: points on surfaces. posts: echoes of what is small. Points of scans may be
    forgotten; the nodes stay. scan_count: so far. node_times: (scan_count + 1,) s; empty before the first scan.
    forgotten: (scan_count,) bool, whose points are. The next scan makes both views invalid.
    """

    def __init__(self, sonar_in_base: np.ndarray) -> None:
        # Compiled loops take no column of a matrix.
        self.sonar_in_base = np.ascontiguousarray(sonar_in_base, dtype=np.float64)
        self.odometry = OdometryLog()
        self._node_times = GrowingArray()
        self.surfaces, self.posts = PointTable(), PointTable()
        self._scans = GrowingArray(kind=_SCAN)
        self._count()

    @property
    def has_plateaus(self) -> bool:
        """Whether most echoes are so long that they are drawn as several points."""
        scans = self._scans.values
        return bool(scans["points"].sum() > _POINTS_OF_PLATEAU * scans["echoes"].sum())

    def take(self, scans: Sequence[Scan], parts: int, lookahead: float) -> None:
        """Append `scans`, each cut into `parts`, all or none; see `append`."""
        before = self.scan_count
        try:
            for scan in scans:
                for part in parts_of(scan, parts, self.node_times[-1] if self.scan_count else None):
                    self.append(part, lookahead)
        except RefusedInput:
            self.shorten(before)
            raise

    def append(self, scan: Scan, lookahead: float) -> None:
        """Append a scan and the odometry of its track up to `lookahead` seconds after its end.

        Raises RefusedInput for a scan that does not end later than the one before.
        """
        sights = Sights.of(scan, self.sonar_in_base)
        points = SurfacePoints.of(scan, sights)
        posts = post_points(scan, sights, points)
        if not len(self._node_times.values):
            self._node_times.extend([min(scan.start, scan.reference_time - _SHORTEST_SCAN)])
        newest = self._node_times.values[-1]
        if scan.reference_time <= newest:
            text = f"ends at {scan.reference_time:.3f} s, the one before at {newest:.3f} s"
            raise RefusedInput("scans out of order", text)
        echoes = (1.0 / sights.per_echo).sum()
        self._scans.extend(np.array([(len(self.odometry), len(scan.points), echoes, False)], _SCAN))
        self._node_times.extend([scan.reference_time])
        self.odometry.extend(scan.track, scan.reference_time + lookahead)
        self.surfaces.append(points)
        self.posts.append(posts)
        self._count()

    def _count(self) -> None:
        self.scan_count = self.surfaces.scan_count
        self.node_times, self.forgotten = self._node_times.values, self._scans.values["forgotten"]

    def shorten(self, scans: int) -> None:
        """Keep the oldest `scans`, as if the others had not been."""
        if scans == self.scan_count:
            return
        self.odometry.shorten(self._scans.values["odometry"][scans])
        for table in (self.surfaces, self.posts, self._scans):
            table.shorten(scans)
        # Without scans no node is known: the next scan begins the run.
        self._node_times.shorten(scans + 1 if scans else 0)
        self._count()

    def forget(self, scans: np.ndarray) -> None:
        """Forget the points of `scans` (n,) bool, those of each scan so far."""
        self.forgotten[: len(scans)] |= scans
        self.surfaces.forget(self.forgotten)
        self.posts.forget(self.forgotten)

    def thin_odometry(self, scan: int) -> None:
        """Keep only about one pose of the odometry in a second before `scan` began."""
        before = len(self.odometry)
        self.odometry.thin(self.node_times[scan])
        lengths = self._scans.values["odometry"]
        lengths[:] = np.maximum(lengths - (before - len(self.odometry)), 0)

    def since(self, scan: int, odometry: Optional[OdometryLog] = None) -> "RunLog":
        """Return a log of `scan` and all later ones, the first of which is number 0 there. It shares the odometry.

        odometry: what was reported instead, if anything.
        """
        later = RunLog(self.sonar_in_base)
        later.odometry = odometry or self.odometry
        later._node_times.extend(self.node_times[scan:])
        later.surfaces, later.posts = self.surfaces.since(scan), self.posts.since(scan)
        later._scans.extend(self._scans.values[scan:])
        later._count()
        return later

    def heard_as(self, change: Callable[[SurfacePoints], SurfacePoints], sonar_in_base: np.ndarray) -> "RunLog":
        """Return a log of all scans whose points are what `change` makes of them, heard at `sonar_in_base` (2,) [m]."""
        other = self.since(0)
        other.sonar_in_base = np.ascontiguousarray(sonar_in_base, dtype=np.float64)
        other.surfaces, other.posts = self.surfaces.since(0, change), self.posts.since(0, change)
        return other

    def grown(self) -> Iterator["RunLog"]:
        """Yield a new log each time it has taken one more scan of this one; it shares the odometry."""
        log = RunLog(self.sonar_in_base)
        log.odometry = self.odometry
        log._node_times.extend(self.node_times[:1])
        for scan in range(self.scan_count):
            log._node_times.extend(self.node_times[scan + 1 : scan + 2])
            log._scans.extend(self._scans.values[scan : scan + 1])
            log.surfaces.append(self.surfaces.heard(scan, scan + 1)[0])
            log.posts.append(self.posts.heard(scan, scan + 1)[0])
            log._count()
            yield log

    def node_motion(self, nodes: np.ndarray) -> Motion:
        """Return what the odometry reported up to `nodes` (n,)."""
        return self.odometry.motion(self.node_times[nodes])

    def node_poses(self, nodes: np.ndarray) -> np.ndarray:
        """Return T_odom_base (n, 3) at `nodes` (n,)."""
        return self.odometry.at(self.node_times[nodes])


def parts_of(scan: Scan, count: int, newest: Optional[float]) -> List[Scan]:
    """Return `count` scans of equal durations that follow each other, with the points of each.

    newest: s, end of the scan before; None without one.
    """
    if count == 1:
        return [scan]
    start = _start(scan, newest)
    ends = np.linspace(start, scan.reference_time, count + 1)[1:]
    ends[-1] = scan.reference_time
    part_of_point = np.minimum(np.searchsorted(ends, scan.times), count - 1)
    parts = enumerate(ends.tolist())
    return [replace(scan.chosen(part_of_point == part), reference_time=end) for part, end in parts]


def _start(scan: Scan, newest: Optional[float]) -> float:
    """Return when the turn began [s]; a scan without points, or with one beam, does not tell."""
    if newest is None:
        return min(scan.start, scan.reference_time - _SHORTEST_SCAN)
    return max(scan.start, newest) if scan.start < scan.reference_time else newest


_LENGTHS = "#"  # after the name of arrays of different lengths, which stand one after the other


def stacked(items: Sequence[Any], prefix: str) -> Dict[str, np.ndarray]:
    """Return for each field its values in all items (n), (n, ...); the fields of a nested dataclass one by one."""
    arrays = {}
    for own in fields(items[0]) if items else ():
        values, name = [getattr(item, own.name) for item in items], prefix + own.name
        if is_dataclass(values[0]):
            arrays.update(stacked(values, f"{name}."))
        elif len({np.shape(value) for value in values}) == 1:
            arrays[name] = np.array(values)
        else:
            arrays[name] = np.concatenate(values)
            arrays[name + _LENGTHS] = np.array([len(value) for value in values])
    return arrays


def unstacked(kind: type, arrays: Mapping[str, np.ndarray], prefix: str) -> List[Any]:
    """Return the dataclasses of type `kind` that `stacked` took; none where `arrays` has no such field.

    Raises KeyError for a field that is missing, and ValueError for fields that are not equally long.
    """
    if not any(name.startswith(prefix) for name in arrays):
        return []
    columns = [_column(own.type, arrays, prefix + own.name) for own in fields(kind)]
    if len({len(column) for column in columns}) != 1:
        raise ValueError(f"{prefix}: {[len(column) for column in columns]} elements")
    return [kind(*values) for values in zip(*columns)]


def _column(kind: type, arrays: Mapping[str, np.ndarray], name: str) -> Sequence[Any]:
    if is_dataclass(kind):
        return unstacked(kind, arrays, f"{name}.")
    array, lengths = arrays[name], arrays.get(name + _LENGTHS)
    if lengths is None:
        return array.tolist() if array.ndim == 1 and kind is not np.ndarray else list(array)
    if lengths.sum() != len(array):
        raise ValueError(f"{name}: {len(array)} elements, must be {lengths.sum()}")
    return np.split(array, np.cumsum(lengths)[:-1])
