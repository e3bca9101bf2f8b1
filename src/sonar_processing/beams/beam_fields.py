"""What a message says of one beam, what readers of several types share, and readers of messages made for pictures."""

import math
from dataclasses import dataclass
from typing import Any, List, Sequence, Union

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


_PIXELS = {0: np.dtype("u1"), 2: np.dtype("u2"), 4: np.dtype("u4")}  # DTYPE_ of SonarImageData that are not signed


def raw_sonar_image(message: Any) -> List[BeamFields]:
    """Read a RawSonarImage of marine_acoustic_msgs; raises RefusedInput for one of several beams.

    Its samples count from `sample0` on; the angle is a turn about the axis that points up.
    """
    strengths, speed = _only_beam(message.image), speed_of_sound_of(message.ping_info.sound_speed)
    padded = np.pad(strengths, (message.sample0, 0), mode="constant")
    resolution = speed / (2.0 * message.sample_rate)
    return [BeamFields.of(message, message.rx_angles[0], padded, resolution, speed_of_sound=speed)]


def projected_sonar_image(message: Any) -> List[BeamFields]:
    """Read a ProjectedSonarImage of marine_acoustic_msgs; raises RefusedInput for one of several beams.

    Its directions have x up, y to the right and z ahead.
    """
    strengths = _only_beam(message.image)
    resolution = length_of_bins(message.ranges, strengths.size)
    padded = np.pad(strengths, (max(round(message.ranges[0] / resolution - 0.5), 0), 0), mode="constant")
    (direction,) = message.beam_directions
    return [BeamFields.of(message, math.atan2(-direction.y, direction.z), padded, resolution)]


def _only_beam(image: Any) -> np.ndarray:
    """Return the strengths of the one beam of a SonarImageData. Raises RefusedInput for several, or signed numbers."""
    if image.beam_count != 1 or image.dtype not in _PIXELS:
        given = f"{image.beam_count} beams of dtype {image.dtype}"
        raise RefusedInput("beams refused", f"{given}; must be one beam of a scanning sonar, of DTYPE_UINT8, 16 or 32")
    kind = _PIXELS[image.dtype].newbyteorder(">" if image.is_bigendian else "<")
    values = np.frombuffer(bytes(image.data), dtype=kind)
    return (values >> (8 * kind.itemsize - 8)).astype(np.uint8)


class TurningImage:
    """Reads the images of Stonefish's MSIS: a column for each step of the head, of which each message renews one.

    Columns go clockwise from astern, rows from the farthest bin to the nearest.
    """

    def __init__(self, reach: float) -> None:
        """`reach`: of all columns, m, which images do not tell; 0 where nobody said it."""
        self._reach = reach
        self._before = np.zeros((0, 0), dtype=np.uint8)
        self._column, self._step = 0, 1

    def __call__(self, message: Any) -> List[BeamFields]:
        """Return the beams that are new in an image. Raises RefusedInput for the first, of which none is known."""
        if not self._reach > 0.0:
            raise RefusedInput("beams refused", "images do not tell how far they reach; set image_range")
        image = np.frombuffer(bytes(message.data), dtype=np.uint8).reshape(message.height, message.step)
        image, before = image[:, : message.width], self._before
        self._before = image
        if before.shape != image.shape:
            raise RefusedInput("beams refused", "the first image of its size does not tell which of its beams is new")
        found = np.flatnonzero((image != before).any(axis=0) & image.any(axis=0))
        if not found.size:
            # A beam that hears what it heard a turn ago.
            found = np.array([(self._column + self._step) % message.width])
        self._step, self._column = 1 if found[-1] >= self._column else -1, int(found[-1])
        angles, resolution = 2.0 * math.pi * found / message.width, self._reach / message.height
        columns = zip(angles, found)
        return [BeamFields.of(message, float(angle), image[::-1, column], resolution) for angle, column in columns]
