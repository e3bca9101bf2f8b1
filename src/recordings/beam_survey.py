"""What can be said of the beams of a recording: how the head turned, its settings, its gaps, and whether it moved."""

from itertools import groupby
from typing import List

import numpy as np

from node_support.geometry import FULL_TURN, wrapped
from recordings.beams import RecordedBeams
from recordings.motion.sweep_shifts import sweep_shifts
from sonar_processing.beams.beam import Beam, PlacedBeam
from sonar_processing.scans.assembler import turns_of

_GAP = 1.0  # s: longer than any head takes for a beam
_WHOLE = 0.9  # share of a circle from which on a sweep counts as a turn: beams may be lost
_MOST_SETTINGS = 6  # that are listed


def beam_lines(recorded: RecordedBeams) -> List[str]:
    """Return sentences on all beams of a recording, at least one."""
    beams = sorted(recorded.beams, key=lambda beam: beam.stamp_ns)
    start, end = beams[0].stamp_ns, beams[-1].stamp_ns
    lost = f"; {recorded.refused} messages were damaged or held none" if recorded.refused else ""
    shifts = sweep_shifts(beams)
    return [
        f"{len(beams)} beams in {(end - start) * 1e-9:.1f} s{lost}",
        _head(beams),
        _settings(beams),
        _gaps(np.array([beam.stamp_ns for beam in beams])),
        f"motion as sweeps show it: {shifts.motion.value}; {shifts}",
    ]


def _head(beams: List[Beam]) -> str:
    angles = np.array([beam.angle for beam in beams])
    steps = wrapped(np.diff(angles))
    steps = np.abs(steps[steps != 0.0])
    if not steps.size:
        return "the head stood still"
    turns = turns_of([PlacedBeam(beam, np.eye(4), is_moving=False) for beam in beams], fewest=2)
    swept = np.array([np.abs(wrapped(np.diff([one.beam.angle for one in turn]))).sum() for turn in turns])
    is_turn = swept >= _WHOLE * FULL_TURN
    told = [f"{is_turn.sum()} whole turns"] if is_turn.any() else []
    if not is_turn.all():
        told.append(f"{(~is_turn).sum()} sweeps of {np.degrees(np.median(swept[~is_turn])):.0f} degrees")
    return f"the head made {' and '.join(told)} in steps of {np.degrees(np.median(steps)):.2g} degrees"


def _settings(beams: List[Beam]) -> str:
    """Return in words which ranges there were from when on."""
    start = beams[0].stamp_ns
    sizes = ((beam.intensities.size, beam.range_resolution, beam.stamp_ns) for beam in beams)
    alike = groupby(sizes, key=lambda one: (one[0], round(one[0] * one[1], 1)))
    found = [(reach, bins, (next(run)[2] - start) * 1e-9) for (bins, reach), run in alike]
    listed = [f"{reach:g} m in {bins} bins from {since:.1f} s" for reach, bins, since in found[:_MOST_SETTINGS]]
    more = f", and {len(found) - _MOST_SETTINGS} changes more" if len(found) > _MOST_SETTINGS else ""
    return f"range: {', '.join(listed)}{more}"


def _gaps(stamps_ns: np.ndarray) -> str:
    seconds = np.diff(stamps_ns) * 1e-9
    gaps = seconds[seconds > _GAP]
    if not gaps.size:
        return f"no gap longer than {_GAP:g} s"
    at = (stamps_ns[int(np.argmax(seconds))] - stamps_ns[0]) * 1e-9
    return f"{len(gaps)} gaps longer than {_GAP:g} s, the longest {gaps.max():.1f} s after {at:.1f} s"
