"""Causes found by trying: under the right hypothesis about mounts and odometry, scans lie on each other."""

from dataclasses import dataclass, replace
from typing import Dict, Iterable, List, NamedTuple, Sequence, Tuple

import numpy as np
from scipy.spatial import cKDTree

from mlsm_manager.scan_matching.scan import Scan, Track
from node_support.geometry import composed, inverse, transformed

_MOST, _FEWEST = 250, 40  # echoes of a scan: more tell nothing new, fewer nothing
_PAIRS, _FEWEST_PAIRS = 60, 10  # pairs of scans, spread over the run: more tell nothing new, fewer nothing
_APART = (1, 2, 3)  # scans between the two of a pair: far enough apart that the vehicle moved
_MOVED = 2.0  # m, or rad times 10 m: by less the scans lie on each other whatever is wrong
_FAR = 4.0  # m: echoes that are farther from all others say no more than that something else is heard
_LEAST_NOISE = 1e-3  # m


@dataclass(frozen=True)
class Hypothesis:
    """What may be wrong. turn: rad, of the sonar against tf, counter-clockwise. is_over: it hangs the other way round.

    ahead, aside: m, of the sonar's true place from that in tf. scale: true over reported distances. delay: s by which
    beams are later than their stamps.
    """

    turn: float = 0.0
    is_over: bool = False
    ahead: float = 0.0
    aside: float = 0.0
    scale: float = 1.0
    delay: float = 0.0


AS_TOLD = Hypothesis()


class Evidence(NamedTuple):
    """nats: over the other hypothesis. gain: m, by which scans lie closer."""

    nats: float
    gain: float


class _Heard(NamedTuple):
    """points: (n, 2) m from the sonar, along base_link's axes, each at its own beam, of `times` (n,) s.

    track: T_odom_base.
    """

    points: np.ndarray
    times: np.ndarray
    track: Track


class ScanPairs:
    """Pairs of scans, and how far they lie apart under a hypothesis."""

    def __init__(self, scans: Sequence[Scan], sonar_in_base: np.ndarray) -> None:
        """sonar_in_base: (2,) m, by tf."""
        self._sonar = sonar_in_base
        self._heard = [_heard(scan, sonar_in_base) for scan in scans if len(scan) >= _FEWEST]
        self._pairs = self._chosen()
        self._known: Dict[Hypothesis, np.ndarray] = {}

    @property
    def tell(self) -> bool:
        """Whether there are enough pairs between which the vehicle moved."""
        return len(self._pairs) >= _FEWEST_PAIRS

    @property
    def times(self) -> np.ndarray:
        """(p, 2) s, when the scans of each pair began to hear and ended."""
        return np.array([[self._heard[one].times[0], self._heard[other].times[-1]] for one, other in self._pairs])

    def _chosen(self) -> List[Tuple[int, int]]:
        """Return pairs of numbers between which the vehicle moved by the odometry, in the order of time."""
        found = []
        ends = [one.track.at(one.times[-1]) for one in self._heard]
        for number in range(len(ends)):
            for apart in _APART:
                if number + apart < len(ends):
                    move = composed(inverse(ends[number]), ends[number + apart])
                    if np.hypot(*move[:2]) + 10.0 * abs(move[2]) > _MOVED:
                        found.append((number, number + apart))
        return found[:: -(-len(found) // _PAIRS)] if found else []

    def distances(self, hypothesis: Hypothesis) -> np.ndarray:
        """Return how far (p,) [m] the scans of each pair lie apart."""
        if hypothesis not in self._known:
            needed = {number for pair in self._pairs for number in pair}
            placed = {number: self._placed(self._heard[number], hypothesis) for number in needed}
            trees = {number: cKDTree(placed[number]) for number in {first for first, _ in self._pairs}}
            apart = [np.minimum(trees[one].query(placed[other])[0], _FAR).mean() for one, other in self._pairs]
            self._known[hypothesis] = np.array(apart)
        return self._known[hypothesis]

    def _placed(self, heard: _Heard, hypothesis: Hypothesis) -> np.ndarray:
        signs = np.array([1.0, -1.0 if hypothesis.is_over else 1.0])
        mount = np.array([self._sonar[0] + hypothesis.ahead, self._sonar[1] + hypothesis.aside, hypothesis.turn])
        poses = heard.track.at(heard.times + hypothesis.delay) * [hypothesis.scale, hypothesis.scale, 1.0]
        return transformed(composed(poses, mount), heard.points * signs)

    def best(self, tried: Iterable[Hypothesis]) -> Hypothesis:
        """Return the hypothesis under which scans lie closest."""
        return min(tried, key=lambda one: float(self.distances(one).mean()))

    def evidence(self, hypothesis: Hypothesis, other: Hypothesis = AS_TOLD) -> Evidence:
        """Return what speaks for a hypothesis against another."""
        return evidence_of(self.distances(other) - self.distances(hypothesis), self.times[:, 0])


def evidence_of(gains: np.ndarray, begins: np.ndarray) -> Evidence:
    """Return what the gains (p,) [m] of pairs tell: half the squared mean over its standard error.

    begins: (p,) s, of the first scan of each pair. Pairs that share it tell the same: the number of scans counts.
    """
    gain = float(gains.mean())
    noise = max(float(gains.std()) / np.sqrt(len(np.unique(begins))), _LEAST_NOISE)
    return Evidence(0.5 * (max(gain, 0.0) / noise) ** 2, gain)


def _heard(scan: Scan, sonar_in_base: np.ndarray) -> _Heard:
    chosen = slice(None, None, -(-len(scan) // _MOST))
    order = np.argsort(scan.times[chosen], kind="stable")
    times, points = scan.times[chosen][order], scan.points[chosen, :2][order]
    return _Heard(transformed(inverse(scan.track.at(times)), points) - sonar_in_base, times, scan.track)


def around(base: Hypothesis, name: str, values: Iterable[float]) -> List[Hypothesis]:
    """Return hypotheses that differ from `base` in the field `name`."""
    return [replace(base, **{name: float(value)}) for value in values]
