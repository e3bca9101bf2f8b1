"""Draws turns of the head as pictures from above."""

from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.image import AxesImage

from sonar_processing.beams.beam import Beam
from sonar_processing.scans.image import PolarImage, SonarImageParameters

STRONGEST = 127
"""All pictures have one scale of strengths: that of the thesis's sonar. What is stronger looks like this."""
COLOURS = "inferno"


@dataclass(frozen=True)
class Turn:
    """Head angles (beams,) rad and strengths (beams, bins) uint8 of a sonar at rest; `reach`: m, end of the bins."""

    angles: np.ndarray
    strengths: np.ndarray
    reach: float

    @property
    def range_resolution(self) -> float:
        """Length of a bin, m."""
        return self.reach / self.strengths.shape[1]


def draw_turn(axes: Axes, turn: Turn) -> AxesImage:
    """Draw what each beam heard where it pointed; x to the right, y up, the sonar in the middle."""
    parameters = SonarImageParameters(beam_width=2.0 * np.pi / len(turn.angles))
    image = PolarImage(parameters)
    for angle, strengths in zip(turn.angles, turn.strengths):
        picture = image.draw(Beam(10**9, "sonar", float(angle), strengths, turn.range_resolution))
    edge = picture.shape[0] * image.metres_per_pixel / 2.0
    # PolarImage draws x up and y to the left.
    return axes.imshow(
        picture[::-1, ::-1].T, origin="lower", extent=(-edge, edge, -edge, edge), cmap=COLOURS, vmin=0, vmax=STRONGEST
    )
