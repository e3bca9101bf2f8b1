"""A map as a picture: top view, to scale."""

from io import BytesIO
from itertools import cycle
from pathlib import Path
from typing import Optional, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import PathPatch
from matplotlib.path import Path as Outline

from mlsm_manager.report.mission import Path as Trajectory
from mlsm_manager.report.mission import Uncertainty
from mlsm_manager.surface_map.blocks import Blocks, BlockType
from node_support.files import write_whole

_COLORS = {BlockType.HORIZONTAL: "#b3362b", BlockType.VERTICAL: "#e0a526"}
_DOUBT_COLOR = "#cc3377"
_MOST_ELLIPSES = 40
_CORNERS = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0], [0.0, 0.0]])
_EDGE = 1.2  # points: two pixels around each cell
_LINE_STYLES = ("-", "--", ":", "-.")


def draw_map(
    file: Path,
    title: str,
    blocks: Blocks,
    outlines: Sequence[np.ndarray],
    paths: Sequence[Trajectory],
    best: Optional[Trajectory] = None,
    uncertainty: Optional[Uncertainty] = None,
) -> None:
    """Write a PNG of the blocks (cells to scale), known outlines [(k, 2) m], paths, and how certain the best one is."""
    figure = Figure(figsize=(14, 8), dpi=110)
    FigureCanvasAgg(figure)
    axes = figure.add_subplot(1, 1, 1)
    for index, outline in enumerate(outlines):
        label = "walls as they are" if index == 0 else None
        axes.plot(*np.asarray(outline).T, color="#1f5fa8", linewidth=1.0, label=label, zorder=4)
    _draw_blocks(axes, blocks)
    for path, style in zip(paths, cycle(_LINE_STYLES)):
        axes.plot(*path.poses[:, :2].T, style, color=path.color, linewidth=1.6, label=path.name, zorder=5)
    if best is not None and uncertainty is not None:
        _draw_uncertainty(axes, best, uncertainty)
    axes.set_aspect("equal")
    axes.set(xlabel="x [m]", ylabel="y [m]", title=title)
    axes.grid(True, color="#dddddd", linewidth=0.5, zorder=0)
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.08), ncol=5, frameon=False)
    axes.autoscale_view()
    figure.tight_layout()
    picture = BytesIO()
    figure.savefig(picture, format="png", bbox_inches="tight")
    write_whole(file, picture.getvalue())


def _draw_uncertainty(axes: Axes, path: Trajectory, uncertainty: Uncertainty) -> None:
    axes.plot(*uncertainty.ellipses(path, _MOST_ELLIPSES).T, color=_DOUBT_COLOR, linewidth=0.8, zorder=6)
    axes.plot([], [], "o", markerfacecolor="none", color=_DOUBT_COLOR, label="two standard deviations")
    doubtful = uncertainty.doubtful_parts(path)
    if len(doubtful):
        axes.plot(*doubtful.T, color=_DOUBT_COLOR, linewidth=6.0, alpha=0.35, label="doubtful", zorder=4)


def _draw_blocks(axes: Axes, blocks: Blocks) -> None:
    for kind, color in _COLORS.items():
        if not np.any(blocks.type == kind):
            continue
        centers = blocks.centers[blocks.type == kind]
        squares = _squares(centers, blocks.resolution)
        # add_patch would look at each corner by itself for the limits, which takes longer than all the rest.
        # Edges of a width in points keep small cells of large water visible.
        axes.add_artist(PathPatch(squares, facecolor=color, edgecolor=color, linewidth=_EDGE, zorder=2 + int(kind)))
        axes.update_datalim(squares.vertices)
        label = f"{len(centers)} {kind.name.lower()} blocks"
        axes.plot([], [], "s", color=color, label=label)


def _squares(centers: np.ndarray, side: float) -> Outline:
    """Return squares around centers (n, 2), n > 0, as one outline: drawn at once, they take a tenth of the time."""
    corners = centers[:, np.newaxis] + side * (_CORNERS - 0.5)
    codes = np.tile([Outline.MOVETO, Outline.LINETO, Outline.LINETO, Outline.LINETO, Outline.CLOSEPOLY], len(centers))
    return Outline(corners.reshape(-1, 2), codes)
