"""The figures of a report."""

import base64
from io import BytesIO
from typing import Optional

import numpy as np
import plotly.graph_objects as go
from PIL import Image

from mlsm_manager.report.compass_rose import north, scale_bar
from mlsm_manager.report.mission import Mission, Path
from mlsm_manager.surface_map.export.rasters import counts, ridges

SCAN_TRACE = "scan at the chosen time"
VEHICLE_TRACE = "vehicle at the chosen time"
_MOST_ELLIPSES = 60
_MOST_BLOCKS = 100_000  # in 3-D: with more, computers without a graphics card can hardly turn the view
_MOST_PATH_POINTS = 5000  # of a path: more cannot be told apart on a screen
_DOUBT = "#cc3377"
_SCAN = "#e07b00"
_LEAST_EXTENT = 0.08  # of the longest side: keeps a flat map from being a line
_FULL_VIEW = 2.0  # plotly's unit of length: the longest side then fills the view
_WALL, _POINTS = "#8c2318", (150, 40, 30)
_FAINTEST, _STRONGEST = 0.12, 0.35  # opacity of cells with one and with many points, behind the walls
_INK = "#333333"


def map_from_above(mission: Mission) -> go.Figure:
    """Return the map with all paths; the last two traces are filled by the slider."""
    figure = go.Figure()
    if len(mission.blocks):
        _add_map(figure, mission)
    for path in [*mission.paths, *mission.further]:
        shown = thinned(path)
        _add_line(figure, shown.poses[:, 0], shown.poses[:, 1], path.name, path.color)
    if mission.uncertainty is not None:
        x, y = mission.uncertainty.ellipses(mission.best, _MOST_ELLIPSES).astype(np.float32).T
        _add_line(figure, x, y, "two standard deviations", _DOUBT, width=1)
        x, y = mission.uncertainty.doubtful_parts(mission.best).T
        if len(x):
            _add_line(figure, x, y, "doubtful", "rgba(204,51,119,0.35)", width=9)
    figure.add_trace(go.Scatter(x=[], y=[], mode="markers", name=SCAN_TRACE, marker={"color": _SCAN, "size": 4}))
    figure.add_trace(
        go.Scatter(
            x=[], y=[], mode="markers", name=VEHICLE_TRACE,
            marker={"color": _SCAN, "size": 12, "symbol": "circle-open", "line": {"width": 3}},
        )
    )  # fmt: skip
    figure.update_xaxes(title="x [m]", showgrid=False, zeroline=False, ticks="outside")
    figure.update_yaxes(title="y [m]", showgrid=False, zeroline=False, ticks="outside", scaleanchor="x")
    return _laid_out(figure, None).update_layout(margin={"r": 50})


def _add_map(figure: go.Figure, mission: Mission) -> None:
    """Add the map's points faintly, its surfaces as lines, and what tells scale and north."""
    numbers, low, side = counts(mission.blocks)
    (left, bottom), (right, top) = low * side, (low + numbers.shape[::-1]) * side
    figure.add_layout_image(
        source=_drawn(numbers[::-1]), xref="x", yref="y", x=left, y=top, sizex=right - left,
        sizey=top - bottom, sizing="stretch", layer="below",
    )  # fmt: skip
    lines = np.pad(ridges(mission.blocks), ((0, 0), (0, 1), (0, 0)), mode="constant", constant_values=np.nan)
    _add_line(figure, *lines.reshape(-1, 2).T.astype(np.float32), "surfaces", _WALL)
    _add_line(figure, np.array([left, right]), np.array([bottom, top]), "", "rgba(0,0,0,0)", hidden=True)
    bar = scale_bar(right - left)
    figure.add_shape(type="line", x0=left, x1=left + bar, y0=bottom, y1=bottom, line={"color": _INK, "width": 4})
    font, ahead = {"color": _INK, "size": 13}, north(mission.origin)
    figure.add_annotation(x=left + bar / 2.0, y=bottom, text=f"{bar:g} m", yanchor="bottom", showarrow=False, font=font)
    figure.add_annotation(
        text="N?" if mission.origin is None else "N", xref="paper", yref="paper", x=1.0, y=0.97, xshift=14, font=font,
        ax=-46.0 * ahead[0], ay=46.0 * ahead[1], arrowhead=2, arrowwidth=2.5, arrowcolor=_INK, showarrow=True,
    )  # fmt: skip


def map_in_3d(mission: Mission) -> go.Figure:
    """Return the blocks, which are not flat, as points at their means, and the best path at their median height."""
    step = max(1, -(-len(mission.blocks) // _MOST_BLOCKS))
    blocks = mission.blocks.take(np.arange(0, len(mission.blocks), step))
    mean = blocks.mean.astype(np.float32)
    bar, name = {"title": "z [m]", "thickness": 14, "len": 0.6}, "map" if step == 1 else f"map, one block of {step}"
    # As diamonds: plotly makes a circle, also one of a pixel, of 19 triangles, a diamond of 5.
    marker = {"size": 1.5, "symbol": "diamond", "color": mean[:, 2], "colorscale": "Turbo", "colorbar": bar}
    figure = go.Figure(
        go.Scatter3d(
            x=mean[:, 0], y=mean[:, 1], z=mean[:, 2], mode="markers", name=name, hoverinfo="skip", marker=marker
        )
    )
    path = thinned(mission.best)
    height = np.full(len(path.times), float(np.median(mean[:, 2])) if len(mean) else 0.0, dtype=np.float32)
    figure.add_trace(
        go.Scatter3d(
            x=path.poses[:, 0], y=path.poses[:, 1], z=height, mode="lines", name=path.name,
            line={"color": path.color, "width": 4},
        )
    )  # fmt: skip
    places = np.concatenate([mean[:, :3], np.column_stack([path.poses[:, :2], height])])
    extent = np.maximum(np.ptp(places, axis=0) / max(np.ptp(places, axis=0).max(), 1e-3), _LEAST_EXTENT) * _FULL_VIEW
    figure.update_scenes(
        aspectmode="manual", aspectratio=dict(zip("xyz", extent.tolist())),
        camera={"eye": {"x": 0.0, "y": -1.3, "z": 1.4}},
        xaxis_title="x [m]", yaxis_title="y [m]", zaxis_title="z [m]",
    )  # fmt: skip
    return _laid_out(figure, 600)


def correction_over_time(mission: Mission) -> go.Figure:
    """Return how far the paths are from the odometry, and how certain the best one says it is."""
    figure = go.Figure()
    odometry = mission.paths[0]
    for path in mission.paths[1:]:
        shown = thinned(path)
        distance = np.hypot(*(shown.poses[:, :2] - odometry.at(shown.times)).T)
        _add_line(figure, shown.times - mission.start, distance, f"{path.name} from {odometry.name}", path.color)
    if mission.uncertainty is not None:
        uncertainty = mission.uncertainty
        radius = np.sqrt(np.trace(uncertainty.covariances, axis1=1, axis2=2))
        _add_line(figure, uncertainty.times - mission.start, radius, "standard deviation of the position", _DOUBT)
        for begin, end in uncertainty.doubtful - mission.start:
            figure.add_vrect(x0=begin, x1=end, fillcolor=_DOUBT, opacity=0.15, line_width=0)
    figure.update_xaxes(title="time [s]")
    figure.update_yaxes(title="distance [m]", rangemode="tozero")
    return _laid_out(figure, 350)


def sensor_health(mission: Mission) -> go.Figure:
    times = np.array([scan.time for scan in mission.scans]) - mission.start
    echoes = [len(scan.points) for scan in mission.scans]
    figure = go.Figure(go.Bar(x=times, y=[scan.missing for scan in mission.scans], name="missing beams", yaxis="y2"))
    _add_line(figure, times, echoes, "echoes", "#1f5fa8")
    figure.update_layout(
        yaxis={"title": "echoes per scan", "rangemode": "tozero"},
        yaxis2={"title": "missing beams", "overlaying": "y", "side": "right", "rangemode": "tozero"},
    )
    figure.update_xaxes(title="time [s]")
    return _laid_out(figure, 300)


def thinned(path: Path) -> Path:
    """Return a path of at most some thousand points."""
    step = max(1, len(path.times) // _MOST_PATH_POINTS)
    return Path(path.name, path.color, path.times[::step], path.poses[::step].astype(np.float32))


def _add_line(
    figure: go.Figure, x: np.ndarray, y: np.ndarray, name: str, color: str, width: float = 2, hidden: bool = False
) -> None:
    line = {"color": color, "width": width}
    figure.add_trace(
        go.Scatter(
            x=x, y=y, mode="lines", name=name, line=line, showlegend=not hidden, hoverinfo="skip" if hidden else None
        )
    )


def _laid_out(figure: go.Figure, height: Optional[int]) -> go.Figure:
    """Return the figure in the page's style; without a height it fills what holds it."""
    return figure.update_layout(
        template="plotly_white", height=height, margin={"l": 60, "r": 20, "t": 40, "b": 50},
        legend={"orientation": "h", "y": -0.12 if height is None else -0.25, "yanchor": "top"},
    )  # fmt: skip


def _drawn(points: np.ndarray) -> str:
    """Return a picture of numbers of points (h, w), transparent where there are none, as an address."""
    image = np.empty((*points.shape, 4), dtype=np.uint8)
    image[..., :3] = _POINTS
    share = np.log1p(points) / max(np.log1p(np.percentile(points[points > 0], 95)), 1e-9)
    opacity = _FAINTEST + (_STRONGEST - _FAINTEST) * np.minimum(share, 1.0)
    image[..., 3] = np.where(points > 0, 255.0 * opacity, 0.0)
    written = BytesIO()
    Image.fromarray(image, "RGBA").save(written, format="PNG", optimize=True)
    return "data:image/png;base64," + base64.b64encode(written.getvalue()).decode("ascii")
