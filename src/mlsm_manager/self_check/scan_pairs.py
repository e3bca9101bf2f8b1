"""Pairs of scans: under the right hypothesis about mounts and odometry they lie on each other.

Honest errors come first: what currents, scales and compasses do the solver's path shows, which every cause must beat.
"""

from dataclasses import dataclass, replace
from typing import Callable, Dict, Iterable, List, NamedTuple, Optional, Sequence, Tuple

import numpy as np

from mlsm_manager.joint_solver.surface_points import LEAST_REACH, surface_normals
from mlsm_manager.odometry.changed_tracks import Mirror
from mlsm_manager.scan_matching.scan import Scan, Track, joined
from mlsm_manager.self_check.compiled_distances import along_x, mean_distance
from node_support.geometry import composed, inverse, rotated, seen_from, transformed

MOST, FEWEST = 250, 40  # echoes of a scan: more tell nothing new, fewer nothing
_PAIRS, _FEWEST_PAIRS = 60, 10  # pairs of scans, spread over the run: more tell nothing new, fewer nothing
_APART = (1, 2, 3)  # scans between the two of a pair: far enough apart that the vehicle moved
_MOVED = 2.0  # m, or rad times 10 m: by less the scans lie on each other whatever is wrong
_FAR = 4.0  # m: echoes that are farther from all others say no more than that something else is heard
_NOISE = 0.2  # m: by less no two scans of one place lie closer, and nothing follows from that
_MOST_TOLD = 20.0  # independent distances in a scan, however alike the pairs are
_LATE = np.arange(-1.0, 3.0)  # s: delays that a head may have with nothing wrong
_NOTHING = 1e-9  # keeps an average of nothing defined
_SCALES = np.arange(0.6, 1.65, 0.1)  # of distances that thrusters report


@dataclass(frozen=True)
class Hypothesis:
    """What may be wrong. turn: rad, of the sonar against tf, counter-clockwise. is_over: it hangs the other way round.

    mirrored: of what the odometry reports, but not its headings; if the sonar is_over as well, these are instead.
    ahead, aside: m, of the sonar's true place from that in tf. scale: true over reported distances. delay: s by which
    beams are later than their stamps. slips: rad/s, by which a head's angles have to grow besides what it reports.
    as_solved: the vehicle went as the solver found it, not as the odometry says.
    """

    turn: float = 0.0
    is_over: bool = False
    mirrored: Mirror = Mirror.NOTHING
    ahead: float = 0.0
    aside: float = 0.0
    scale: float = 1.0
    delay: float = 0.0
    slips: float = 0.0
    as_solved: bool = False


AS_TOLD = Hypothesis()


class ScanPairs:
    """Pairs of scans, and how far they lie apart under a hypothesis.

    begins, middles: (n,) s, of each scan. times: (p, 2) s, when the scans of each pair began to hear and ended. scans:
    how many begin a pair.
    """

    def __init__(
        self, scans: Sequence[Scan], sonar_in_base: np.ndarray, corrections: Optional[Track] = None
    ) -> None:  # fmt: skip
        """sonar_in_base: (2,) m, by tf. corrections: T_map_odom as the solver found it; None where none did yet."""
        self._sonar, self._corrections = sonar_in_base, corrections
        heard = [_heard(scan, sonar_in_base) for scan in scans if len(scan) >= FEWEST]
        # Of all scans, from the sonar, along base_link's axes, each at its own beam.
        self._points = np.concatenate([points for points, _ in heard] or [np.empty((0, 2))])
        self._times = np.concatenate([times for _, times in heard] or [np.empty(0)])
        self._ends = np.cumsum([len(times) for _, times in heard], dtype=int)
        self._reported = joined([scan.track for scan in scans]) if scans else None
        self._tracks: Dict[Mirror, Track] = {}
        self._pairs = self._chosen()
        self.begins = np.array([times[0] for _, times in heard])
        self.middles = np.array([times.mean() for _, times in heard])
        ends = [[self.begins[one], self._times[self._ends[other] - 1]] for one, other in self._pairs]
        self.times = np.array(ends).reshape(-1, 2)
        self.scans = len(np.unique(self.times[:, 0]))
        self._known: Dict[Hypothesis, np.ndarray] = {}
        self._ways: Dict[Hypothesis, np.ndarray] = {}

    @property
    def tell(self) -> bool:
        return len(self._pairs) >= _FEWEST_PAIRS

    def _chosen(self) -> List[Tuple[int, int]]:
        """Return pairs of numbers between which the vehicle moved by the odometry, in the order of time."""
        found = []
        ends = [self._reported.at(self._times[end - 1]) for end in self._ends]
        for number in range(len(ends)):
            for apart in _APART:
                if number + apart < len(ends):
                    move = seen_from(ends[number], ends[number + apart])
                    if np.hypot(*move[:2]) + 10.0 * abs(move[2]) > _MOVED:
                        found.append((number, number + apart))
        return found[:: -(-len(found) // _PAIRS)] if found else []

    def distances(self, hypothesis: Hypothesis) -> np.ndarray:
        """Return how far (p,) [m] the scans of each pair lie apart."""
        if hypothesis not in self._known:
            placed = self._placed(hypothesis)
            targets = {number: along_x(placed[number]) for number in {first for first, _ in self._pairs}}
            self._known[hypothesis] = np.array([_apart(targets[one], placed[other]) for one, other in self._pairs])
        return self._known[hypothesis]

    def _placed(self, hypothesis: Hypothesis, ranges: float = 1.0) -> List[np.ndarray]:
        """Return where echoes (n, 2) [m] of each scan are, with `ranges` times their distances from the sonar."""
        signs = np.array([1.0, -1.0 if hypothesis.is_over else 1.0])
        mounts = np.tile([*self._sonar, hypothesis.turn], (len(self._times), 1))
        mounts += np.array([hypothesis.ahead, hypothesis.aside, 0.0])
        mounts[:, 2] += hypothesis.slips * (self._times - self._times[:1])
        in_base = transformed(mounts, ranges * signs * self._points)
        return np.split(transformed(self._poses(hypothesis), in_base), self._ends)[:-1]

    def _poses(self, hypothesis: Hypothesis) -> np.ndarray:
        """Return where the vehicle was at each echo (n, 3) of all scans; mounts change nothing of it."""
        went = replace(hypothesis, turn=0.0, is_over=False, ahead=0.0, aside=0.0, slips=0.0)
        if went not in self._ways:
            if went.mirrored not in self._tracks:
                self._tracks[went.mirrored] = went.mirrored.of(self._reported)
            times = self._times + went.delay
            poses = self._tracks[went.mirrored].at(times) * [went.scale, went.scale, 1.0]
            self._ways[went] = composed(self._corrections.at(times), poses) if went.as_solved else poses
        return self._ways[went]

    def best(self, tried: Iterable[Hypothesis]) -> Hypothesis:
        return min(tried, key=lambda one: float(self.distances(one).mean()))

    @property
    def honest(self) -> Hypothesis:
        """The likeliest of those with which nothing is wrong."""
        if self._corrections is None:
            return self.best(around(AS_TOLD, "scale", _SCALES))
        return self.best([AS_TOLD, *around(Hypothesis(as_solved=True), "delay", _LATE)])

    @property
    def way(self) -> float:
        """How far the vehicle went by the odometry, m."""
        return float(np.hypot(*np.diff(self._reported.poses[:, :2], axis=0).T).sum())

    def evidence(self, hypothesis: Hypothesis, other: Hypothesis) -> float:
        """Return what speaks for a hypothesis against another, nats."""
        return evidence_of(self.distances(other), self.distances(hypothesis), self.scans)

    def near(self, base: Hypothesis) -> Tuple[np.ndarray, np.ndarray]:
        """Return what `near_pairs` does for all scans as they lie if `base` is right."""
        return near_pairs(self._placed(base))

    def carried(self, pairs: np.ndarray, velocities: np.ndarray, base: Hypothesis) -> np.ndarray:
        """Return how far (k, p) [m] scans of `pairs` (p, 2) lie apart if the vehicle went by `velocities` (k, 2) [m/s]
        faster than it does if `base` is right.
        """
        placed = self._placed(base)

        def moved(one: int, other: int) -> List[np.ndarray]:
            return [placed[other] + move for move in velocities * (self.middles[other] - self.middles[one])]

        return _table(pairs, placed, moved)

    def changed(self, pairs: np.ndarray, changes: Sequence["Change"], base: Hypothesis) -> np.ndarray:
        """Return how far (k, p) [m] scans of `pairs` (p, 2) lie apart if the later one has each of `changes` (k)."""
        placed = {ranges: self._placed(base, ranges) for ranges in {1.0, *(one.ranges for one in changes)}}

        def moved(_: int, other: int) -> List[np.ndarray]:
            centre = self._poses(base)[self._ends[other] - 1, :2]
            late = {ranges: scans[other] - centre for ranges, scans in placed.items()}
            return [rotated(late[one.ranges], np.full(len(late[one.ranges]), one.turn)) + centre for one in changes]

        return _table(pairs, placed[1.0], moved)

    def facing(self, numbers: Iterable[int], base: Hypothesis) -> np.ndarray:
        """Return the mean outer product (2, 2) of the normals of surfaces that some scans heard if `base` is right.

        Each normal is weighted by how certain it is.
        """
        placed = self._placed(base)
        told = [surface_normals(placed[number], np.full(len(placed[number]), LEAST_REACH)) for number in numbers]
        normals, qualities = map(np.concatenate, zip(*told))
        return np.einsum("n,na,nb->ab", qualities, normals, normals) / max(qualities.sum(), _NOTHING)

    def in_odometry(self, velocity: np.ndarray, time: float, base: Hypothesis) -> np.ndarray:
        """Return a velocity (2,) of `carried` in odom."""
        if not base.as_solved:
            return velocity
        return rotated(velocity[np.newaxis], -self._corrections.at(np.array([time]))[:, 2])[0]

    def typical_range(self) -> float:
        """Return the median range of echoes, m."""
        return float(np.median(np.hypot(*self._points.T)))


class Change(NamedTuple):
    """turn: rad, of a head that slipped. ranges: true over reported ones."""

    turn: float
    ranges: float


def near_pairs(placed: Sequence[np.ndarray]) -> Tuple[np.ndarray, np.ndarray]:
    """Return the numbers (p, 2) of scans up to three apart, and how far (p,) [m] they lie apart; placed: (n, 2) m."""
    targets = [along_x(places) for places in placed]
    pairs = [(one, one + apart) for apart in _APART for one in range(len(placed) - apart)]
    distances = [_apart(targets[one], placed[other]) for one, other in pairs]
    return np.array(pairs, dtype=int).reshape(-1, 2), np.array(distances)


def _apart(targets: np.ndarray, places: np.ndarray) -> float:
    """Return how far [m] `places` (n, 2) lie from `targets`, which are in the order of x."""
    return mean_distance(targets, np.ascontiguousarray(places), _FAR)


def evidence_of(apart: np.ndarray, closer: np.ndarray, scans: int, alike: Optional[np.ndarray] = None) -> float:
    """Return by how much (nats) distances `closer` (p,) [m] are likelier than `apart` (p,) that another cause leaves.

    Mean distances of scans are taken to be distributed as gamma, with a mean that nobody knows, as the water tells it.
    Echoes of a scan hang together: as many are independent as the spread of `alike` says (by default of `closer`), and
    pairs that share a scan tell the same, so that `scans` count.
    """
    usual = closer if alike is None else alike
    told = float(np.clip((usual.mean() / max(usual.std(), 1e-9)) ** 2, 1.0, _MOST_TOLD))
    return scans * told * float(np.log((apart.mean() + _NOISE) / (closer.mean() + _NOISE)))


def _table(
    pairs: np.ndarray, placed: Sequence[np.ndarray], moved: Callable[[int, int], List[np.ndarray]]
) -> np.ndarray:  # fmt: skip
    """Return how far (k, p) [m] scans of `pairs` (p, 2) lie apart with the later one at each of the places that
    `moved` returns for their numbers; placed: (n, 2) m, of each scan.
    """
    columns = []
    for one, other in pairs:
        earlier = along_x(placed[one])
        columns.append([_apart(earlier, places) for places in moved(one, other)])
    return np.array(columns).T.copy()


def _heard(scan: Scan, sonar_in_base: np.ndarray) -> Tuple[np.ndarray, np.ndarray]:
    """Return where echoes (n, 2) [m] of a scan are from the sonar, along base_link's axes, and their times (n,) [s]."""
    chosen = slice(None, None, -(-len(scan) // MOST))
    order = np.argsort(scan.times[chosen], kind="stable")
    times, points = scan.times[chosen][order], scan.points[chosen, :2][order]
    return transformed(inverse(scan.track.at(times)), points) - sonar_in_base, times


def around(base: Hypothesis, name: str, values: Iterable[float]) -> List[Hypothesis]:
    return [replace(base, **{name: float(value)}) for value in values]
