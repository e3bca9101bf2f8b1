"""Pauses in which the head was not heard."""

from sonar_processing.beams.beam import Beam

_LONGEST_NS = 10 * 10**9
"""Longer than any head takes for some beams, shorter than a slow turn: the vehicle is elsewhere by then."""


def long_after(beam: Beam, earlier: Beam) -> bool:
    """Return whether the head was silent so long between two beams that they make no scan together."""
    return beam.stamp_ns - earlier.stamp_ns > _LONGEST_NS
