"""The map from above as an image of one pixel per cell."""

import base64
from dataclasses import dataclass
from io import BytesIO

import numpy as np
from PIL import Image

from mlsm_manager.surface_map.blocks import Blocks

_MOST_PIXELS = 4000  # of a side: more makes browsers slow; beyond it several cells share a pixel
_COLOR = (150, 40, 30)
_FAINTEST = 0.35  # opacity of a cell with one point: still seen on white


@dataclass(frozen=True)
class MapImage:
    """url: a PNG as a data URL. low, high: (2,) x y [m] of its lower left and upper right corner."""

    url: str
    low: np.ndarray
    high: np.ndarray


def map_image(blocks: Blocks) -> MapImage:
    """Return the picture of a map that has at least one block; cells with more points are darker."""
    cells = blocks.cells
    first = cells.min(axis=0)
    side = -(-int((cells.max(axis=0) - first).max() + 1) // _MOST_PIXELS)
    pixels = (cells - first) // side
    width, height = pixels.max(axis=0) + 1
    points = np.zeros((height, width))
    np.add.at(points, (height - 1 - pixels[:, 1], pixels[:, 0]), blocks.count)
    low = first * blocks.resolution
    return MapImage(_data_url(_drawn(points)), low, low + np.array([width, height]) * side * blocks.resolution)


def _drawn(points: np.ndarray) -> Image.Image:
    """Return a picture of numbers of points (h, w), transparent where there are none."""
    image = np.empty((*points.shape, 4), dtype=np.uint8)
    image[..., :3] = _COLOR
    share = np.log1p(points) / max(np.log1p(np.percentile(points[points > 0], 95)), 1e-9)
    opacity = np.clip(_FAINTEST + (1.0 - _FAINTEST) * share, 0.0, 1.0)
    image[..., 3] = np.where(points > 0, 255.0 * opacity, 0.0)
    return Image.fromarray(image, "RGBA")


def _data_url(image: Image.Image) -> str:
    written = BytesIO()
    image.save(written, format="PNG", optimize=True)
    return "data:image/png;base64," + base64.b64encode(written.getvalue()).decode("ascii")
