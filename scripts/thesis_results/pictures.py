"""Pictures of the page: small PNG files, and what is drawn in several of them: blocks, turns of the head, worlds."""

from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import Sequence, Tuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.figure import Figure
from matplotlib.image import AxesImage
from PIL import Image, ImageChops

from mlsm_manager.surface_map.blocks import Blocks, BlockType
from node_support.files import write_whole
from sonar_processing.beams.beam import Beam
from sonar_processing.scans.image import PolarImage, SonarImageParameters
from sonar_simulator.world.world import World, world_triangles
from thesis_results.page import prose

MOST_BYTES = 200_000
"""Of one picture: all of them are in the repository, in every version."""
_RESOLUTIONS = (110, 95, 80, 65, 50)  # dots per inch, the best that fits is taken
_COLOURS = 256  # of the palette: a third of the bytes, and no difference is seen
STRONGEST = 127
"""All pictures have one scale of strengths: that of the thesis's sonar. What is stronger looks like this."""
COLOURS = "inferno"
_BLOCK_COLOURS = {BlockType.HORIZONTAL: (0.72, 0.15, 0.12), BlockType.VERTICAL: (0.98, 0.87, 0.50)}
"""The thesis's: red, and light yellow for vertical blocks."""
_LEAST_HEIGHT = 0.08  # m: a block of one point is drawn this high
_CORNERS = np.array([[0, 0], [1, 0], [1, 1], [0, 1]])


class Pictures:
    """A folder of pictures beside a page."""

    def __init__(self, folder: Path, page: Path) -> None:
        self._folder = folder
        self._page = page

    def save(self, name: str, figure: Figure, what: str) -> str:
        """Write NAME.png and return the Markdown that shows it, with `what` it shows below.

        It gets the best resolution that fits. Raises ValueError where even the coarsest is too large.
        """
        for resolution in _RESOLUTIONS:
            full = BytesIO()
            figure.savefig(full, format="png", dpi=resolution, facecolor="white", bbox_inches="tight")
            png = _in_few_colours(full.getvalue())
            if len(png) <= MOST_BYTES:
                return self._write(name, png, what)
        raise ValueError(f"a picture of {len(png)} bytes at {resolution} dpi, must be {MOST_BYTES} or less")

    def copied(self, name: str, file: Path, what: str) -> str:
        """Write a picture that a program made to NAME.png, in fewer colours, and return its Markdown as `save` does."""
        return self._write(name, _in_few_colours(file.read_bytes()), what)

    def _write(self, name: str, png: bytes, what: str) -> str:
        self._folder.mkdir(parents=True, exist_ok=True)
        path = self._folder / f"{name}.png"
        write_whole(path, png)
        shown = path.relative_to(self._page.parent).as_posix()
        return f"![{name.replace('_', ' ')}]({shown})\n\n*{prose(what)}*"


def new_figure(width: float, height: float, rows: int = 1, columns: int = 1) -> Tuple[Figure, np.ndarray]:
    """Return a figure of `width` x `height` inches and its axes (rows, columns)."""
    figure = Figure(figsize=(width, height), constrained_layout=True)
    FigureCanvasAgg(figure)
    return figure, figure.subplots(rows, columns, squeeze=False)


def to_scale(axes: Axes, title: str, reach: float, middle: Sequence[float] = (0.0, 0.0)) -> None:
    """Make one metre as long in x as in y, and show `reach` [m] around `middle` [m]."""
    axes.set(aspect="equal", title=title, xlabel="x, m", ylabel="y, m")
    axes.set(xlim=(middle[0] - reach, middle[0] + reach), ylim=(middle[1] - reach, middle[1] + reach))


def _in_few_colours(png: bytes) -> bytes:
    """Return the picture with fewer colours and without white around it, which boxes in space have much of."""
    small, image = BytesIO(), Image.open(BytesIO(png)).convert("RGB")
    image = image.crop(ImageChops.invert(image).getbbox()).quantize(_COLOURS, method=Image.FASTOCTREE, dither=0)
    image.save(small, format="png", optimize=True)
    return small.getvalue()


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


def draw_world(axes: Axes, world: World, place: Sequence[float]) -> None:
    """Draw a world's triangles, the highest last, around `place` x y z [m]."""
    points, colours = world_triangles(world)
    corners = points.reshape(-1, 3, 3) - np.array(place)
    order = np.argsort(corners[..., 2].mean(axis=1))
    axes.add_collection(
        PolyCollection(corners[order, :, :2], facecolors=colours[::3][order], linewidths=0, antialiaseds=False)
    )


def draw_outlines(axes: Axes, world: World, label: str) -> None:
    """Draw the outlines of what stands upright."""
    lines = [np.asarray(outline)[:, :2] for outline in world.outlines()]
    axes.add_collection(LineCollection(lines, colors="#1f5fa8", linewidths=1.0, zorder=1, label=label))


def drawn_in_space(blocks: Blocks, direction: float, elevation: float) -> Figure:
    """Return a figure of blocks as boxes in parallel projection, seen from `direction` and `elevation` [rad]."""
    figure = Figure(figsize=(9.0, 9.0), constrained_layout=True)
    axes = figure.add_subplot(projection="3d", proj_type="ortho")
    low = blocks.centers - blocks.resolution / 2.0
    height = np.maximum(blocks.depth, _LEAST_HEIGHT)
    colours = [_BLOCK_COLOURS[BlockType(int(kind))] for kind in blocks.type]
    axes.bar3d(*low.T, blocks.bottom, blocks.resolution, blocks.resolution, height, colours, shade=True)
    axes.view_init(np.degrees(elevation), np.degrees(direction))
    axes.set_box_aspect([np.ptp(axis) for axis in (axes.get_xlim(), axes.get_ylim(), axes.get_zlim())], zoom=1.12)
    axes.set_axis_off()
    return figure


def draw_from_above(axes: Axes, blocks: Blocks, alpha: float = 1.0) -> None:
    """Draw the cells of blocks, vertical ones on top."""
    order = np.argsort(blocks.type, kind="stable")
    plan = (blocks.centers - blocks.resolution / 2.0)[order, np.newaxis] + _CORNERS * blocks.resolution
    colours = np.array([_BLOCK_COLOURS[BlockType(int(kind))] for kind in blocks.type[order]]).reshape(-1, 3)
    axes.add_collection(PolyCollection(plan, facecolors=colours, linewidths=0, alpha=alpha))
    axes.autoscale_view()
