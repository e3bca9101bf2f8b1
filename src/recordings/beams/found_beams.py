"""All beams of a recording."""

from dataclasses import dataclass, field, replace
from typing import List

import numpy as np

from sonar_processing.beams.beam import Beam


@dataclass(frozen=True)
class FoundBeams:
    """beams: in the order of the recording. moving: whether the vehicle moved then. refused: messages without a beam.

    notes: what was assumed, as sentences.
    """

    beams: List[Beam]
    moving: List[bool]
    refused: int = 0
    notes: List[str] = field(default_factory=list)

    @property
    def stamps_ns(self) -> np.ndarray:
        """(n,) int64, ns, in the order of the recording."""
        return np.array([beam.stamp_ns for beam in self.beams], dtype=np.int64)

    def later(self, seconds: float) -> "FoundBeams":
        """Return the same beams with `seconds` added to their stamps. Raises RefusedInput for a stamp below 0."""
        if seconds == 0.0:
            return self
        shift = round(seconds * 1e9)
        return replace(self, beams=[replace(beam, stamp_ns=beam.stamp_ns + shift) for beam in self.beams])
