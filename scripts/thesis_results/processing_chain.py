"""What the processing chain makes of one scan, stage by stage, and pictures of it."""

from dataclasses import dataclass, replace
from typing import List

import numpy as np
from matplotlib.axes import Axes

from sonar_processing.cloud import IntensityCloud
from sonar_processing.filters.outliers import OutlierRemover, OutlierRemoverParameters
from sonar_processing.filters.threshold import Thresholder, ThresholderParameters, ThresholdMode
from sonar_processing.shapes.lines import Line, LineDetector, LineDetectorParameters
from thesis_results.pictures import Pictures, new_figure, to_scale
from thesis_results.scan_images import COLOURS, STRONGEST

_MOST_POINTS = 60_000  # of a picture: more do not show


@dataclass(frozen=True)
class Processed:
    """A scan after each stage, taken from `place` (2,) m.

    otsu, threshold: Otsu's threshold, and the one that the default mode makes of it.
    """

    place: np.ndarray
    raw: IntensityCloud
    thresholded: IntensityCloud
    cleaned: IntensityCloud
    lines: List[Line]
    otsu: float
    threshold: float

    @property
    def stages(self) -> dict:
        """Name of each stage and its cloud."""
        return {"raw": self.raw, "thresholded": self.thresholded, "cleaned": self.cleaned}


def processed(raw: IntensityCloud, place: np.ndarray, lines: LineDetectorParameters) -> Processed:
    """Return what the stages with their default parameters, and the line detector, make of an organised scan."""
    parameters = ThresholderParameters()
    by_otsu, thresholder = Thresholder(replace(parameters, mode=ThresholdMode.OTSU)), Thresholder(parameters)
    by_otsu(raw)
    thresholded = thresholder(raw)
    cleaned = OutlierRemover(OutlierRemoverParameters())(thresholded)
    thresholds = by_otsu.newest_threshold, thresholder.newest_threshold
    return Processed(place, raw, thresholded, cleaned, LineDetector(lines)(cleaned), *thresholds)


def draw_stages(pictures: Pictures, name: str, scan: Processed, reach: float, what: str) -> str:
    """Save the stages side by side and return their Markdown; `reach` [m] from the sonar is shown."""
    figure, (axes,) = new_figure(16.0, 4.6, 1, 4)
    for cell, (stage, cloud) in zip(axes, scan.stages.items()):
        _draw_cloud(cell, cloud)
        to_scale(cell, f"{stage}: {np.count_nonzero(cloud.valid)} points", reach, scan.place)
    points = scan.cleaned.points[scan.cleaned.valid]
    axes[3].plot(points[:, 0], points[:, 1], ".", color="#bbbbbb", markersize=1.5)
    for line in scan.lines:
        axes[3].plot(*line.ends.T, color="#c2185b", linewidth=2.0)
    to_scale(axes[3], f"lines: {len(scan.lines)}", reach, scan.place)
    for cell in axes[1:]:
        cell.set(ylabel="")
    return pictures.save(name, figure, what)


def _draw_cloud(axes: Axes, cloud: IntensityCloud) -> None:
    points = cloud.points[cloud.valid]
    points = points[points[:, 3] > 0]
    points = points[:: max(1, len(points) // _MOST_POINTS)]
    points = points[np.argsort(points[:, 3])]
    axes.set_facecolor("black")
    axes.scatter(points[:, 0], points[:, 1], c=points[:, 3], s=1.5, cmap=COLOURS, vmin=0, vmax=STRONGEST, linewidths=0)
