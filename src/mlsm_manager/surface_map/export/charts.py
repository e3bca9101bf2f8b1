"""Maps on charts: GeoTIFF in any system of coordinates, and folders of tiles."""

from io import BytesIO
from pathlib import Path
from typing import Any, Optional, Tuple

import numpy as np

from georeferencing.origin import Origin
from mlsm_manager.surface_map.blocks import Blocks
from mlsm_manager.surface_map.export.rasters import counts, elevation, ridges
from mlsm_manager.surface_map.map_file import ExportError
from node_support.errors import needed
from node_support.files import whole_file, write_whole

_BANDS = ("highest point [m]", "number of points")
_MERCATOR, _EQUATOR = "EPSG:3857", 40075016.685578488  # m, its circumference
_TILE = 256  # pixels of a side
_CLOSEST = 22  # zoom: no map on the web goes closer
_SHARPNESS = 2  # pixels on a side of a cell
_POINTS, _WALL = (150, 40, 30, 110), (140, 35, 24, 255)
_Grid = Any  # affine.Affine, which comes with rasterio


def write_geotiff(path: Path, blocks: Blocks, origin: Optional[Origin] = None, crs: str = "") -> None:
    """Write height, NaN where there is none, and number of points of each cell, whole or not at all.

    crs: as "EPSG:25831", north up; the default is the origin's zone of UTM, without an origin a local grid. Raises
    ExportError without rasterio, for an unknown system or for one without an origin; OSError.
    """
    if crs and origin is None:
        raise ExportError(f"--crs {crs}: the map does not know where it lies; map_bag --origin tells it")
    heights, side = elevation(blocks), blocks.resolution
    points = np.zeros(heights.values.shape)
    low = np.rint(heights.origin / side).astype(np.int64)
    np.add.at(points, tuple((blocks.cells - low).T[::-1]), blocks.count)
    bands, grid = np.stack([heights.values, points]).astype(np.float32), _grid(low * side, side)
    if origin is None:
        rows = heights.values.shape[0]
        bands, grid = bands[:, ::-1], grid * grid.translation(0.0, rows) * grid.scale(1.0, -1.0)
    else:
        crs = crs or origin.utm
        bands, grid = _north_up(bands, grid, origin, crs)
    kind = {"driver": "GTiff", "count": 2, "dtype": "float32", "nodata": np.nan, "compress": "deflate"}
    size = {"height": bands.shape[1], "width": bands.shape[2]}
    opened = _rasterio().open
    with whole_file(path) as part, opened(str(part), "w", crs=crs or None, transform=grid, **size, **kind) as file:
        file.write(bands)
        file.descriptions = _BANDS


def write_tiles(folder: Path, blocks: Blocks, origin: Origin) -> int:
    """Write FOLDER/Z/X/Y.png for maps on the web (XYZ) and return how many: points faintly, surfaces as lines.

    From the zoom at which all is in one tile to that at which a pixel is no larger than a cell.
    Raises ExportError without rasterio or for a map that is too large, and OSError.
    """
    picture, low, side = _picture(blocks)
    zoom = int(np.ceil(np.log2(_EQUATOR * np.cos(np.radians(origin.latitude_deg)) / _TILE / blocks.resolution)))
    zoom = min(zoom, _CLOSEST)
    corners = np.array([[x, y] for x in (0, picture.shape[2]) for y in (0, picture.shape[1])]) * side + low
    tiles = _tiles_at(origin.degrees(corners), zoom)
    first, last = np.floor(tiles.min(axis=0)).astype(int), np.floor(tiles.max(axis=0)).astype(int)
    pixel = _EQUATOR / 2.0**zoom / _TILE
    left, top = first * _TILE * pixel - _EQUATOR / 2.0
    size = (last - first + 1) * _TILE
    target = _grid((left, -top), pixel, -pixel)
    mosaic = _warped(picture, _grid(low, side), origin, _MERCATOR, (target, size[::-1])).transpose(1, 2, 0)
    written = 0
    while True:
        written += _write_zoom(folder / str(zoom), mosaic, first)
        if zoom == 0 or np.prod(mosaic.shape[:2]) <= _TILE**2:
            return written
        mosaic, first, zoom = _halved(mosaic, first), first // 2, zoom - 1


def _picture(blocks: Blocks) -> Tuple[np.ndarray, np.ndarray, float]:
    """Return red, green, blue and opacity (4, rows, columns), the lowest y first, its corner (2,) m and a pixel, m."""
    from PIL import Image, ImageDraw

    numbers, low, side = counts(blocks)
    image = np.zeros((*numbers.shape, 4), dtype=np.uint8)
    image[numbers > 0.0] = _POINTS
    sharp = Image.fromarray(image.repeat(_SHARPNESS, axis=0).repeat(_SHARPNESS, axis=1), "RGBA")
    draw = ImageDraw.Draw(sharp)
    for ends in (ridges(blocks) / side - low) * _SHARPNESS:
        draw.line(ends.ravel().tolist(), fill=_WALL, width=_SHARPNESS)
    return np.moveaxis(np.asarray(sharp), -1, 0), low * side, side / _SHARPNESS


def _tiles_at(degrees: np.ndarray, zoom: int) -> np.ndarray:
    """Return x y (n, 2) of latitudes and longitudes (n, 2) in tiles of a zoom, from the north-west."""
    latitude, longitude = np.radians(degrees).T
    return 2.0**zoom * np.column_stack([longitude / np.pi + 1.0, 1.0 - np.arcsinh(np.tan(latitude)) / np.pi]) / 2.0


def _write_zoom(folder: Path, mosaic: np.ndarray, first: np.ndarray) -> int:
    """Write the tiles of one zoom that show something; `first`: x y of the upper left one."""
    from PIL import Image

    written = 0
    for row in range(mosaic.shape[0] // _TILE):
        for column in range(mosaic.shape[1] // _TILE):
            tile = mosaic[row * _TILE : (row + 1) * _TILE, column * _TILE : (column + 1) * _TILE]
            if tile[..., 3].any():
                data = BytesIO()
                Image.fromarray(tile, "RGBA").save(data, format="PNG")
                write_whole(folder / str(first[0] + column) / f"{first[1] + row}.png", data.getvalue())
                written += 1
    return written


def _halved(mosaic: np.ndarray, first: np.ndarray) -> np.ndarray:
    """Return the mosaic of the next zoom out: of four pixels the most opaque one, so that thin lines stay."""
    before = (first % 2) * _TILE
    size = np.array(mosaic.shape[:2])
    after = -(size + before[::-1]) % (2 * _TILE)
    padded = np.pad(mosaic, ((before[1], after[0]), (before[0], after[1]), (0, 0)), mode="constant")
    rows, columns = np.array(padded.shape[:2]) // 2
    fours = padded.reshape(rows, 2, columns, 2, 4).swapaxes(1, 2).reshape(rows, columns, 4, 4)
    best = fours[..., 3].argmax(axis=-1)
    return np.take_along_axis(fours, best[..., np.newaxis, np.newaxis], axis=2)[:, :, 0]


def _north_up(bands: np.ndarray, grid: _Grid, origin: Origin, crs: str) -> Tuple[np.ndarray, _Grid]:
    """Return bands (b, rows, columns) in another system of coordinates, and their grid there."""
    warp = _rasterio().warp
    rows, columns = bands.shape[1:]
    turned = _turned(grid, origin)
    corners = np.array([turned * corner for corner in ((0, 0), (columns, 0), (0, rows), (columns, rows))])
    box = [*corners.min(axis=0), *corners.max(axis=0)]
    system = _system(crs)
    # Where coordinates are degrees, pixels have to be told in degrees too: as many as there are cells.
    cells = np.ceil((corners.max(axis=0) - corners.min(axis=0)) / grid.a).astype(int).tolist()
    side = {} if system.is_geographic else {"resolution": grid.a}
    target, width, height = warp.calculate_default_transform(origin.plane, system, *cells, *box, **side)
    return _warped(bands, grid, origin, crs, (target, (height, width))), target


def _warped(
    bands: np.ndarray, grid: _Grid, origin: Origin, crs: str, target: Tuple[_Grid, Tuple[int, int]]
) -> np.ndarray:
    """Return bands (b, rows, columns) at the grid and of the size of a target, the nearest cell at each place."""
    nothing = np.nan if bands.dtype == np.float32 else 0
    into = np.full((len(bands), *target[1]), nothing, dtype=bands.dtype)
    _rasterio().warp.reproject(
        bands, into, src_transform=_turned(grid, origin), src_crs=origin.plane, dst_transform=target[0],
        dst_crs=_system(crs), dst_nodata=nothing,
    )  # fmt: skip
    return into


def _grid(corner: Tuple[float, float], width: float, height: Optional[float] = None) -> _Grid:
    affine = _rasterio().Affine
    return affine.translation(*corner) * affine.scale(width, width if height is None else height)


def _turned(grid: _Grid, origin: Origin) -> _Grid:
    return grid.rotation(float(np.degrees(origin.yaw))) * grid


def _system(crs: str) -> Any:
    rasterio = _rasterio()
    try:
        return rasterio.crs.CRS.from_string(crs)
    except rasterio.errors.CRSError:
        raise ExportError(f"--crs {crs}: not known; must be as EPSG:25831") from None


def _rasterio() -> Any:
    # GDAL takes a quarter of a second and 60 MB: who needs no chart shall not wait for it.
    how = "apt install python3-rasterio"
    needed("rasterio.warp", how, ExportError)
    return needed("rasterio", how, ExportError)
