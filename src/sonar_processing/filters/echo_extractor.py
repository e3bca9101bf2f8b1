"""The stage echo_extractor: from an organised polar cloud to the points of its echoes."""

from typing import Optional

import numpy as np

from node_support.errors import RefusedInput
from sonar_processing.cloud import IntensityCloud
from sonar_processing.filters.echo_extraction import EchoExtractorParameters, extract_echoes

_ROWS_MEASURED = 8  # Rows of a cloud that tell the length of a bin; it is the same in all of them


class EchoExtractor:
    """Works on whole scans; a moving vehicle makes no difference, for every bin brings its own place."""

    def __init__(self, parameters: EchoExtractorParameters) -> None:
        self.parameters = parameters
        self.newest_threshold: Optional[float] = None
        """The height that parted echoes from speckle in the newest scan."""

    def __call__(self, cloud: IntensityCloud) -> IntensityCloud:
        """Return the echoes of an organised cloud (rows are beams, columns are bins) as a cloud without order.

        The strength of a point is the height by which its echo stands out. Bins that a stage removed (NaN) are silent,
        and no echo lies on them. Raises RefusedInput for a cloud that is not organised or of too few beams.
        """
        if not cloud.is_organized:
            raise RefusedInput("clouds refused", "not organised; subscribe the echo extractor to sonar/scan/polar")
        rows = cloud.points.reshape(cloud.height, -1, 4)
        strengths = np.nan_to_num(rows[..., 3], nan=0.0, posinf=0.0, neginf=0.0)
        echoes = extract_echoes(strengths, bin_length(rows), self.parameters)
        self.newest_threshold = echoes.threshold
        points = places(rows, echoes.beams, echoes.bins)
        points[:, 3] = echoes.heights
        stamps = cloud.time_stamps.reshape(cloud.height, -1)[echoes.beams, 0]
        found = IntensityCloud(points, stamps, cloud.stamp_ns, cloud.frame_id)
        return found.select(found.valid)


def bin_length(rows: np.ndarray) -> float:
    """Return the distance between neighbouring bins of an organised cloud (beams, bins, 4), m.

    Raises RefusedInput when no two neighbours are left to tell it from.
    """
    some = rows[:: max(len(rows) // _ROWS_MEASURED, 1), :, :3]
    lengths = np.linalg.norm(np.diff(some, axis=1), axis=2)
    lengths = lengths[np.isfinite(lengths)]
    lengths = lengths[lengths > 0.0]
    if lengths.size == 0:
        raise RefusedInput("clouds refused", "no two neighbouring bins are left; check min_range and height_limit")
    return float(np.median(lengths))


def places(rows: np.ndarray, beams: np.ndarray, bins: np.ndarray) -> np.ndarray:
    """Return (n, 4) float32: the points between the bins of an organised cloud (beams, bins, 4).

    Bins before the first or after the last lie on the continued beam.
    """
    lower = np.clip(np.floor(bins).astype(np.int64), 0, max(rows.shape[1] - 2, 0))
    upper = np.minimum(lower + 1, rows.shape[1] - 1)
    share = (bins - lower).astype(np.float32)[:, np.newaxis]
    return rows[beams, lower] * (1.0 - share) + rows[beams, upper] * share
