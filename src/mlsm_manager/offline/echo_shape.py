"""What the strengths of a recording tell of its echoes, and so how they are best extracted and matched."""

from enum import Enum
from typing import Collection, Optional, Sequence

import numpy as np

from mlsm_manager.offline.replay_parameters import ReplayParameters
from sonar_processing.beams.beam import Beam
from sonar_processing.filters.echo_extractor import ExtractionMode

# Share of non-zero strengths that equal the strongest.
_BINARY = 0.9
_AT_ONCE = 1000  # beams that are counted together: bounds the memory


class EchoShape(Enum):
    """What an echo looks like along a beam.

    PEAK: strengths differ; an echo has a peak, and noise has no sharp edge. PLATEAU: strengths only say "something" or
    "nothing"; an echo is metres long, its middle means nothing, and the surface is where it begins.
    """

    PEAK = "PEAK"
    PLATEAU = "PLATEAU"


_SUITED = {
    # Weak echoes count: what they are compared with tells them from speckle.
    EchoShape.PEAK: {
        "mode": ExtractionMode.MATCHED_FILTER,
        "match_resolution": 0.5,
        "threshold_share": 0.5,
        "min_height": 2.0,
    },
    # Plateaus lengthen with range, and the middle of their points moves outwards with them: by some percent of range.
    EchoShape.PLATEAU: {
        "mode": ExtractionMode.DENSE,
        "spacing": 1.0,
        "match_resolution": 1.0,
        "range_scale_deviation": 0.05,
    },
}


def echo_shape_of(beams: Sequence[Beam]) -> EchoShape:
    """Return PLATEAU where nearly all echoes are as strong as any, else PEAK."""
    counts = np.zeros(256, dtype=np.int64)
    for start in range(0, len(beams), _AT_ONCE):
        strengths = np.concatenate([beam.intensities for beam in beams[start : start + _AT_ONCE]])
        counts += np.bincount(strengths, minlength=256)
    counts = counts[1:]
    if not counts.any():
        return EchoShape.PEAK
    strongest = counts[np.flatnonzero(counts)[-1]]
    return EchoShape.PLATEAU if strongest >= _BINARY * counts.sum() else EchoShape.PEAK


def suited(
    parameters: ReplayParameters, shape: EchoShape, fixed: Collection[str], sigma: Optional[float] = None
) -> ReplayParameters:
    """Return `parameters` with those that suit the shape of the echoes, but for those that are `fixed`.

    sigma: m, standard deviation of an echo along range, of peaks.
    """
    values = dict(_SUITED[shape])
    if shape is EchoShape.PEAK and sigma is not None:
        values["pulse_sigma"] = round(sigma, 3)
    return parameters.changed({name: value for name, value in values.items() if name not in fixed})
