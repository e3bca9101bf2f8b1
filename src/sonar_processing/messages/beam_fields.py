"""What a message says of one beam, and what the readers of several types share."""

from dataclasses import dataclass
from typing import Any, Sequence, Union

import numpy as np

from node_support.errors import RefusedInput
from node_support.headers import stamp_ns

USUAL_SPEED_OF_SOUND = 1500.0  # m/s, what drivers assume where a message does not say
_SLOWEST, _FASTEST = 1300.0, 1700.0  # m/s, of any water; a message with another value was not filled in
_UNEVEN = 0.1  # Share by which the lengths of bins may differ, as float32 rounds their ranges


@dataclass(frozen=True)
class BeamFields:
    """One beam as its message has it.

    stamp_ns: of the header, ns. angle: of the head, in the unit and direction of the message. intensities: (bins,)
    uint8. range_resolution: length of a bin, m. sensor_angle: tilt of the servo, rad. speed_of_sound: m/s.
    """

    stamp_ns: int
    frame_id: str
    angle: float
    intensities: np.ndarray
    range_resolution: float
    sensor_angle: float = 0.0
    speed_of_sound: float = USUAL_SPEED_OF_SOUND

    @classmethod
    def of(cls, message: Any, angle: float, intensities: np.ndarray, resolution: float, **more: float) -> "BeamFields":
        """Return a beam with stamp and frame of the header of `message`; more: of the fields that have a default."""
        return cls(stamp_ns(message.header), message.header.frame_id, angle, intensities, resolution, **more)

    @property
    def travel_time_ns(self) -> int:
        """How long the sound takes to the last bin and back, ns."""
        return round(2e9 * self.intensities.size * self.range_resolution / self.speed_of_sound)


def length_of_bins(ranges: Sequence[float], strengths: int) -> float:
    """Return how far apart the ranges of bins are, m. Raises RefusedInput where they are no bins of one beam."""
    steps = np.diff(np.asarray(ranges, dtype=np.float64))
    if strengths != len(ranges) or not steps.size or not (steps > 0.0).all() or np.ptp(steps) > _UNEVEN * steps.mean():
        given = f"{len(ranges)} ranges of one beam, {strengths} strengths"
        raise RefusedInput("beams refused", f"{given}: bins need a strength each and ranges that grow evenly")
    return float(steps.mean())


def speed_of_sound_of(value: float) -> float:
    """Return a speed of sound, m/s: the one of a message, or the usual one where the message was not filled in."""
    return value if _SLOWEST <= value <= _FASTEST else USUAL_SPEED_OF_SOUND


def strengths_of(values: Union[bytes, Sequence[int]]) -> np.ndarray:
    """Return strengths (bins,) as uint8."""
    if isinstance(values, (bytes, bytearray)):
        return np.frombuffer(values, dtype=np.uint8)
    return np.asarray(values).astype(np.uint8)
