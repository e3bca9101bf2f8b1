"""Draws beams into a picture of what lies around the sonar, seen from above."""

import math
from dataclasses import dataclass
from typing import Optional

import numpy as np

from node_support.errors import RefusedInput
from node_support.geometry import wrapped
from node_support.parameters import parameter
from sonar_processing.beams.beam import Beam
from sonar_processing.beams.parameters import beam_width_parameter
from sonar_processing.beams.reader import BeamMessageParameters

MOST_PIXELS = 3000  # A picture of 9 MB; more, at the rate of beams, is too much for a network
_USUAL_PIXELS = 501  # Odd, so that the head is in the middle of a pixel; a bin is then about a pixel
_WIDEST_STEP = 0.2  # rad: a wider step is no step but a gap, as where a sector begins anew


@dataclass(frozen=True)
class SonarImageParameters(BeamMessageParameters):
    metres_per_pixel: float = parameter(
        0.0, f"size of a pixel; 0: the range fits into {_USUAL_PIXELS} pixels", unit="m", low=0.0, high=10.0
    )
    beam_width: float = beam_width_parameter("least width at which a beam is drawn; wider where the head's steps are")
    max_rate: float = parameter(20.0, "most images per second", unit="1/s", low=0.1, high=1000.0)


@dataclass(frozen=True)
class _Canvas:
    """Which bin every pixel shows, for one length of beam; pixels are sorted by their direction from the head."""

    side: int
    metres_per_pixel: float
    directions: np.ndarray
    pixels: np.ndarray
    bins: np.ndarray


class PolarImage:
    """A square mono8 picture with the head in its middle: up is +x of the sonar, left is +y.

    Each beam replaces what lay in its direction; beams of another length or resolution begin a new picture.
    """

    def __init__(self, parameters: SonarImageParameters) -> None:
        self.parameters = parameters
        self.clear()

    def clear(self) -> None:
        self._canvas: Optional[_Canvas] = None
        self._drawn_for = (0, 0.0)
        self._last_angle: Optional[float] = None

    @property
    def metres_per_pixel(self) -> float:
        """Side of a pixel, m; of the picture that the newest beam was drawn into."""
        return self._canvas.metres_per_pixel

    def draw(self, beam: Beam) -> np.ndarray:
        """Draw a beam; return the picture (side, side) uint8, which the next beam will change.

        Raises RefusedInput when the picture would have more than `MOST_PIXELS` pixels in a row.
        """
        length = (beam.intensities.size, beam.range_resolution)
        if self._canvas is None or self._drawn_for != length:
            self._canvas = _canvas(*length, self.parameters.metres_per_pixel)
            self._image = np.zeros((self._canvas.side, self._canvas.side), dtype=np.uint8)
            self._drawn_for = length
        step = 0.0 if self._last_angle is None else abs(wrapped(beam.angle - self._last_angle))
        half = max(self.parameters.beam_width, step if step < _WIDEST_STEP else 0.0) / 2.0
        first, last = wrapped(beam.angle - half), wrapped(beam.angle + half)
        begin, end = np.searchsorted(self._canvas.directions, [first, last])
        for part in [slice(begin, end)] if first <= last else [slice(begin, None), slice(0, end)]:
            self._image.ravel()[self._canvas.pixels[part]] = beam.intensities[self._canvas.bins[part]]
        self._last_angle = beam.angle
        return self._image


def _canvas(bins: int, range_resolution: float, metres_per_pixel: float) -> _Canvas:
    reach = bins * range_resolution
    size = metres_per_pixel or reach / (_USUAL_PIXELS // 2)
    half = math.ceil(reach / size)
    side = 2 * half + 1
    if side > MOST_PIXELS:
        raise RefusedInput(
            "images refused",
            f"{side} pixels in a row, must be at most {MOST_PIXELS}; raise metres_per_pixel, {size:g} at {reach:g} m",
        )
    up, left = np.mgrid[half : -half - 1 : -1, half : -half - 1 : -1]
    bin_shown = (np.hypot(up, left) * (size / range_resolution)).astype(np.int64).ravel()
    pixels = np.flatnonzero(bin_shown < bins)
    directions = np.arctan2(left.ravel()[pixels], up.ravel()[pixels])
    order = np.argsort(directions)
    pixels = pixels[order]
    return _Canvas(side, size, directions[order], pixels, bin_shown[pixels])
