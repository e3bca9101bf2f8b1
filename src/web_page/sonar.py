"""The newest revolution of the sonar, beam by beam."""

import math
from typing import Callable, List, Optional

import numpy as np

from node_support.geometry import wrapped
from sonar_processing.beams.beam import Beam
from web_page.messages import Ray, beam_bytes

_BINS = 200  # of a beam: a pixel each where the picture is as wide as a hand
_SLOTS = 400  # directions of the bow: as fine as the finest heads step
_NARROWEST = 0.0436  # rad: width of a beam
_WIDEST_STEP = 0.2  # rad: a wider step is a gap, as where a sector begins anew


class SonarDisc:
    """Makes each beam ready to be drawn; the next one in its direction takes its place."""

    def __init__(self, put: Callable[[int, bytes], None], clear: Callable[[List[int]], None]) -> None:
        """`put` takes the number of a direction and the bytes of its beam, `clear` those of a revolution that ended."""
        self._put, self._clear = put, clear
        self._reach = 0.0
        self._last: Optional[float] = None

    def take(self, beam: Beam, T_base_sonar: np.ndarray, T_map_sonar: np.ndarray) -> None:
        """Take a beam and where the sonar is (4, 4) on the vehicle and in the map."""
        reach = beam.intensities.size * beam.range_resolution
        if abs(reach - self._reach) > 0.01 * reach:
            self._clear(list(range(_SLOTS)))
        self._reach = reach
        ahead = np.array([math.cos(beam.angle), math.sin(beam.angle), 0.0])
        from_bow, in_map = (math.atan2(*(turn @ ahead)[1::-1]) for turn in (T_base_sonar[:3, :3], T_map_sonar[:3, :3]))
        step = 0.0 if self._last is None else abs(wrapped(from_bow - self._last))
        self._last = from_bow
        width = max(_NARROWEST, step if step < _WIDEST_STEP else 0.0)
        slot = round(from_bow / (2.0 * math.pi) * _SLOTS) % _SLOTS
        ray = Ray(from_bow, in_map, width, *T_map_sonar[:2, 3])
        self._put(slot, beam_bytes(reach, ray, pooled(beam.intensities)))


def pooled(strengths: np.ndarray) -> np.ndarray:
    """Return at most 200 strengths: of bins that share one, the strongest."""
    starts = np.unique(np.arange(_BINS) * len(strengths) // _BINS)
    return np.maximum.reduceat(strengths, starts)
