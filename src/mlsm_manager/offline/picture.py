"""A map as a picture: top view, to scale."""

from io import BytesIO
from itertools import cycle
from pathlib import Path
from typing import Optional, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from georeferencing.origin import Origin
from mlsm_manager.report.compass_rose import north, scale_bar
from mlsm_manager.report.mission import Path as Trajectory
from mlsm_manager.report.mission import Uncertainty
from mlsm_manager.surface_map.blocks import Blocks
from mlsm_manager.surface_map.export.rasters import counts, ridges
from node_support.files import write_whole

_WALL, _POINTS, _INK, _GRATICULE = "#8c2318", "#fcc3ab", "#333333", "#5b7fa6"
_DOUBT_COLOR = "#cc3377"
_MOST_ELLIPSES = 40
_ROOM = 0.25  # of the larger side of map and paths: for ellipses on each side
_LINE_STYLES = ("-", "--", ":", "-.")


def draw_map(
    file: Path,
    title: str,
    blocks: Blocks,
    paths: Sequence[Trajectory],
    best: Optional[Trajectory] = None,
    uncertainty: Optional[Uncertainty] = None,
    origin: Optional[Origin] = None,
) -> None:
    """Write a PNG of the blocks, paths, and how certain the best one is; with an origin on a graticule."""
    figure = Figure(figsize=(14, 8), dpi=110)
    FigureCanvasAgg(figure)
    axes = figure.add_subplot(1, 1, 1)
    if len(blocks):
        _draw_blocks(axes, blocks)
    for path, style in zip(paths, cycle(_LINE_STYLES)):
        # A dot where it begins: of a vehicle that stood nothing else would be seen.
        begin = {"marker": "o", "markersize": 4.0, "markevery": [0]}
        axes.plot(*path.poses[:, :2].T, style, color=path.color, linewidth=1.6, label=path.name, zorder=5, **begin)
    if best is not None and uncertainty is not None:
        _draw_uncertainty(axes, best, uncertainty)
    axes.set_aspect("equal")
    axes.set(xlabel="x [m]", ylabel="y [m]", title=title)
    if origin is not None:
        _draw_graticule(axes, origin)
    _draw_scale(axes, origin)
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.08), ncol=6, frameon=False)
    figure.tight_layout()
    picture = BytesIO()
    figure.savefig(picture, format="png", bbox_inches="tight")
    write_whole(file, picture.getvalue())


def _draw_uncertainty(axes: Axes, path: Trajectory, uncertainty: Uncertainty) -> None:
    """Draw ellipses; they widen the view by a quarter on each side at most, so that the map stays readable."""
    axes.autoscale_view()
    low, high = np.transpose([axes.get_xlim(), axes.get_ylim()])
    axes.plot(*uncertainty.ellipses(path, _MOST_ELLIPSES).T, color=_DOUBT_COLOR, linewidth=0.8, zorder=6)
    axes.plot([], [], "o", markerfacecolor="none", color=_DOUBT_COLOR, label="two standard deviations")
    doubtful = uncertainty.doubtful_parts(path)
    if len(doubtful):
        axes.plot(*doubtful.T, color=_DOUBT_COLOR, linewidth=6.0, alpha=0.35, label="doubtful", zorder=4)
    axes.autoscale_view()
    room = _ROOM * (high - low).max()
    wide_low, wide_high = np.transpose([axes.get_xlim(), axes.get_ylim()])
    (left, bottom), (right, top) = np.maximum(wide_low, low - room), np.minimum(wide_high, high + room)
    axes.set(xlim=(left, right), ylim=(bottom, top))


def _draw_blocks(axes: Axes, blocks: Blocks) -> None:
    numbers, low, side = counts(blocks)
    (left, bottom), (right, top) = low * side, (low + numbers.shape[::-1]) * side
    shades = np.ma.masked_equal(np.log1p(numbers), 0.0)
    axes.imshow(
        shades, origin="lower", extent=(left, right, bottom, top), cmap="Reds", vmin=-0.5 * shades.max(),
        vmax=5.0 * shades.max(), interpolation="nearest", zorder=2,
    )  # fmt: skip
    axes.add_collection(LineCollection(ridges(blocks), colors=_WALL, linewidths=1.8, zorder=3))
    axes.plot([], [], "s", color=_POINTS, label="points")
    axes.plot([], [], color=_WALL, label="surfaces")


def _draw_scale(axes: Axes, origin: Optional[Origin]) -> None:
    """Draw a scale bar below all else, and an arrow to the north."""
    (left, right), (bottom, top) = axes.get_xlim(), axes.get_ylim()
    bottom -= 0.08 * (top - bottom)
    axes.set_ylim(bottom, top)
    bar = scale_bar(right - left)
    start, height = left + 0.03 * (right - left), bottom + 0.03 * (top - bottom)
    axes.plot([start, start + bar], [height, height], color=_INK, linewidth=4.0, solid_capstyle="butt", zorder=7)
    above = (start + bar / 2.0, height)
    axes.annotate(f"{bar:g} m", above, (0, 5), textcoords="offset points", ha="center", color=_INK)
    arrow = {"arrowstyle": "-|>", "color": _INK, "linewidth": 2.0}
    axes.annotate(
        "N?" if origin is None else "N", (0.95, 0.9), -38.0 * north(origin), xycoords="axes fraction", ha="center",
        textcoords="offset points", arrowprops=arrow, va="center", color=_INK, zorder=7,
    )  # fmt: skip


def _draw_graticule(axes: Axes, origin: Origin) -> None:
    """Draw lines of latitude and longitude, with their degrees where they begin."""
    limits = np.array([axes.get_xlim(), axes.get_ylim()])
    degrees = origin.degrees(np.stack(np.meshgrid(*limits), axis=-1).reshape(-1, 2))
    low, high = degrees.min(axis=0), degrees.max(axis=0)
    rim = 0.03 * np.ptp(limits, axis=1)
    for axis, letters in enumerate(("SN", "WE")):
        for value in MaxNLocator(6).tick_values(low[axis], high[axis]):
            ends = np.array([low, high])
            ends[:, axis] = value
            line = origin.points(np.linspace(*ends, 200))
            axes.plot(*line.T, color=_GRATICULE, linewidth=0.6, zorder=1)
            inside = line[((line > limits[:, 0]) & (line < limits[:, 1] - rim)).all(axis=1)]
            text = f"{abs(value):.5f}\u00b0 {letters[int(value >= 0.0)]}"
            if len(inside):
                axes.annotate(text, inside[0], (3, 3), textcoords="offset points", color=_GRATICULE, fontsize=8)
    axes.set(xlim=limits[0], ylim=limits[1])
