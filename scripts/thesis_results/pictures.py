"""Saves figures as small PNG files."""

from io import BytesIO
from pathlib import Path
from typing import Sequence, Tuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from PIL import Image

from node_support.files import write_whole
from thesis_results.markdown import prose

MOST_BYTES = 200_000
"""Of one picture: all of them are in the repository, in every version."""
_RESOLUTIONS = (110, 95, 80, 65, 50)  # dots per inch, the best that fits is taken
_COLOURS = 256  # of the palette: a third of the bytes, and no difference is seen


class Pictures:
    """A folder of pictures beside a page."""

    def __init__(self, folder: Path, page: Path) -> None:
        self._folder = folder
        self._page = page

    def save(self, name: str, figure: Figure, what: str) -> str:
        """Write NAME.png and return the Markdown that shows it, with `what` it shows below."""
        self._folder.mkdir(parents=True, exist_ok=True)
        path = self._folder / f"{name}.png"
        write_whole(path, _small_png(figure))
        what = prose(what)
        return f"![{name.replace('_', ' ')}]({path.relative_to(self._page.parent).as_posix()})\n\n*{what}*"


def new_figure(width: float, height: float, rows: int = 1, columns: int = 1) -> Tuple[Figure, np.ndarray]:
    """Return a figure of `width` x `height` inches and its axes (rows, columns)."""
    figure = Figure(figsize=(width, height), constrained_layout=True)
    FigureCanvasAgg(figure)
    return figure, figure.subplots(rows, columns, squeeze=False)


def to_scale(axes: Axes, title: str, reach: float = 0.0, middle: Sequence[float] = (0.0, 0.0)) -> None:
    """Make one metre as long in x as in y; with a `reach` [m], show this much around `middle` [m]."""
    axes.set(aspect="equal", title=title, xlabel="x, m", ylabel="y, m")
    if reach:
        axes.set(xlim=(middle[0] - reach, middle[0] + reach), ylim=(middle[1] - reach, middle[1] + reach))


def _small_png(figure: Figure) -> bytes:
    """Raise ValueError where even the coarsest resolution is too large."""
    for resolution in _RESOLUTIONS:
        data = _png(figure, resolution)
        if len(data) <= MOST_BYTES:
            return data
    raise ValueError(f"a picture of {len(data)} bytes at {resolution} dpi, must be {MOST_BYTES} or less")


def _png(figure: Figure, resolution: int) -> bytes:
    full, small = BytesIO(), BytesIO()
    figure.savefig(full, format="png", dpi=resolution, facecolor="white", bbox_inches="tight")
    image = Image.open(full).convert("RGB").quantize(_COLOURS, method=Image.FASTOCTREE, dither=0)
    image.save(small, format="png", optimize=True)
    return small.getvalue()
