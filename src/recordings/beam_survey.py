"""What can be said of the beams of a recording: how the head turned, its settings, its gaps, and whether it moved."""

from itertools import groupby
from typing import List

import numpy as np

from node_support.geometry import FULL_TURN, wrapped
from recordings.beams import RecordedBeams
from recordings.motion.sweep_shifts import sweep_shifts
from sonar_processing.beams.beam import Beam

_GAP = 1.0  # s: longer than any head takes for a beam
_MOST_SETTINGS = 6  # that are listed


def beam_lines(recorded: RecordedBeams) -> List[str]:
    """Return sentences on all beams of a recording, at least one."""
    beams = sorted(recorded.beams, key=lambda beam: beam.stamp_ns)
    start, end = beams[0].stamp_ns, beams[-1].stamp_ns
    lost = f"; {recorded.refused} messages were damaged or held none" if recorded.refused else ""
    shifts = sweep_shifts(beams)
    return [
        f"{len(beams)} beams in {(end - start) * 1e-9:.1f} s{lost}",
        _head(np.array([beam.angle for beam in beams])),
        _settings(beams),
        _gaps(np.array([beam.stamp_ns for beam in beams])),
        f"motion as sweeps show it: {shifts.motion.value}; {shifts}",
    ]


def _head(angles: np.ndarray) -> str:
    steps = wrapped(np.diff(angles))
    steps = steps[steps != 0.0]
    if not steps.size:
        return "the head stood still"
    usual = float(np.median(np.abs(steps)))
    swept = [abs(sum(run)) for _, run in groupby(steps, key=lambda step: step > 0.0)]
    sweeps = np.array([one for one in swept if one > 1.5 * usual])
    step = f"steps of {np.degrees(usual):.2g} degrees"
    if len(sweeps) < 2 or sweeps.max() >= FULL_TURN:
        return f"{sweeps.sum() / FULL_TURN:.1f} turns of the head, {step}"
    return f"{len(sweeps)} sweeps to and fro of {np.degrees(np.median(sweeps)):.0f} degrees, {step}"


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
