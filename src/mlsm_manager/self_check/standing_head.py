"""When the head stood, by the angles that it reports or by what it hears: one direction makes no scan."""

from typing import List, NamedTuple, Sequence, Tuple

import numpy as np

from mlsm_manager.self_check.causes import CERTAIN, Cause
from node_support.timing import stretches
from sonar_processing.beams.beam import Beam

_STANDS = 20.0  # s: longer than any head waits between two beams, about a turn
_NAMED = 10.0  # s: shorter times in which all directions hear the same are left out, but not named
_STILL = 1e-3  # rad: heads step by ten times as much
_NEVER_TURNS = 0.9  # share of the beams of one angle, from which on the head is not meant to turn
_ALIKE = 0.25  # of the difference of strengths to their sum: beams of one direction have less, of others three times it
# The usual difference, of so many beams, from which on alike ones tell that the head stands: sonars that hear noise
# alone have up to 0.51, those that hear walls 0.76 and more.
_DIFFER, _BEAMS = 0.6, 500
_MOSTLY = 0.5  # share of the beams of some seconds that are alike; where the vehicle turns they shift by bins
_SPEED = 0.3  # m/s: the usual speed of a small vehicle, which nothing corrects while the head stands


class HeadStood(NamedTuple):
    """From when to when [s] the head stood; is_told: whether it reported one angle all the time."""

    begin: float
    end: float
    is_told: bool

    @property
    def seconds(self) -> float:
        return self.end - self.begin


def head_stood(beams: Sequence[Beam], usual: float = 0.0) -> Tuple[List[HeadStood], float]:
    """Return when the head stood, of beams in the order of their stamps; told, it did so for more than 20 s.

    The second value tells how different beams of two directions are when the head turns: 0 equal, 1 nothing in common.
    It is never less than `usual`, which is that of earlier beams.
    """
    times = np.array([beam.stamp_ns for beam in beams]) * 1e-9
    angles = np.array([beam.angle for beam in beams])
    untold, usual = _untold(times, angles, beams, usual)
    return [*_told(times, angles), *untold], usual


def of_standing(stood: Sequence[HeadStood]) -> List[Cause]:
    """Return the causes: of each time that was told, and of the longest that was not."""
    told = [one for one in stood if one.is_told]
    untold = [one for one in stood if not one.is_told and one.seconds >= _NAMED]
    longest = [max(untold, key=lambda one: one.seconds)] if untold else []
    causes = []
    for one in (*told, *longest):
        text = f"the head stood for {one.seconds:.0f} s{'' if one.is_told else ' though it reported that it turns'},"
        gone = _SPEED * float(np.sqrt(one.seconds * _STANDS)) / 2.0
        causes.append(Cause(text, CERTAIN, one.begin, metres=gone))
    return causes


def _told(times: np.ndarray, angles: np.ndarray) -> List[HeadStood]:
    """Return stretches in which the head reports one angle, unless it never turns."""
    still = _are_equal(angles[1:], angles[:-1])
    if not len(still) or still.mean() > _NEVER_TURNS:
        return []
    found = [HeadStood(float(times[first]), float(times[last]), True) for first, last in stretches(still)]
    return [one for one in found if one.seconds > _STANDS]


def _untold(
    times: np.ndarray, angles: np.ndarray, beams: Sequence[Beam], usual: float
) -> Tuple[List[HeadStood], float]:  # fmt: skip
    """Return stretches in which all directions hear the same, though the head reports that it turns."""
    apart = max(len(beams) // 400, 10)  # beams after which the head usually looks elsewhere
    strengths = [beam.intensities.astype(np.float32) for beam in beams]
    differences = np.array([_difference(*pair) for pair in zip(strengths, strengths[apart:])])
    told = np.isfinite(differences) & ~_are_equal(angles[apart:], angles[:-apart])
    count = int(np.count_nonzero(told))
    if count >= 2 * apart:
        parts = np.array_split(differences[told], max(count // _BEAMS, 1))
        usual = max(usual, *(float(np.median(part)) for part in parts))
    near = np.ones(6 * apart + 1) / (6 * apart + 1)
    if len(differences) < len(near) or usual < _DIFFER:
        return [], usual
    share = np.convolve(np.where(told, differences, np.inf) < _ALIKE, near, "same")
    found = stretches(share > _MOSTLY)
    return [HeadStood(float(times[first]), float(times[last - 1 + apart]), False) for first, last in found], usual


def _difference(one: np.ndarray, other: np.ndarray) -> float:
    """Return how different the strengths of two beams are: 0 equal, 1 nothing in common; NaN where both are silent."""
    if len(one) != len(other):
        return 1.0
    total = float(one.sum() + other.sum())
    return float(np.abs(one - other).sum()) / total if total else np.nan


def _are_equal(angles: np.ndarray, others: np.ndarray) -> np.ndarray:
    return np.abs(np.angle(np.exp(1j * (angles - others)))) < _STILL
