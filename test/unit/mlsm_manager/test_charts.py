"""Maps on charts, opened with GDAL as QGIS and others do, and the lines that surfaces are drawn with."""

import json
import shutil
import subprocess

import numpy as np
import pytest
from made_maps import map_with
from PIL import Image

from georeferencing.origin import STORED, Origin
from mlsm_manager.surface_map.export.charts import write_geotiff, write_tiles
from mlsm_manager.surface_map.export.formats import ExportOptions, export
from mlsm_manager.surface_map.export.rasters import counts, ridges
from mlsm_manager.surface_map.map_file import ExportError, Layer, StoredMap

RESOLUTION = 0.5
ORIGIN = Origin(41.2, 3.1, 78.0)
EAST_WALL, NORTH_WALL = 60.0, 40.0  # m


def wall(ends, points=4000, spread=1.0, seed=0):
    """Return the blocks of echoes that scatter by `spread` [m] about a line between two places."""
    generator = np.random.default_rng(seed)
    (start, end), share = np.array(ends), generator.uniform(size=(points, 1))
    places = start + share * (end - start) + generator.normal(scale=spread, size=(points, 2))
    return map_with(np.column_stack([places, np.full(points, -2.0), np.full(points, 50.0)]), RESOLUTION).blocks


@pytest.fixture(scope="module")
def blocks():
    return wall([(0.0, 0.0), (EAST_WALL, NORTH_WALL)])


@pytest.fixture(scope="module")
def stored(blocks):
    return StoredMap("map", {Layer.SHOWN: blocks}, arrays={STORED: ORIGIN.array})


def described(path):
    """Return what gdalinfo says of a file."""
    if shutil.which("gdalinfo") is None:
        pytest.skip("gdalinfo is not installed")
    told = subprocess.run(["gdalinfo", "-json", str(path)], check=True, stdout=subprocess.PIPE).stdout
    return json.loads(told)


def looked_up(path, code, degrees):
    """Return what QGIS's library finds in both bands (2, n) at latitudes and longitudes (n, 2)."""
    gdal = pytest.importorskip("osgeo.gdal", reason="python3-gdal is not installed")
    from osgeo import osr

    gdal.UseExceptions()
    file, here, there = gdal.Open(str(path)), osr.SpatialReference(), osr.SpatialReference()
    here.ImportFromEPSG(4326)
    there.ImportFromWkt(file.GetProjection())
    assert there.GetAuthorityCode(None) == code
    for one in (here, there):
        one.SetAxisMappingStrategy(osr.OAMS_TRADITIONAL_GIS_ORDER)
    to_pixels = gdal.InvGeoTransform(file.GetGeoTransform())
    places = [
        gdal.ApplyGeoTransform(to_pixels, *place[:2])
        for place in osr.CoordinateTransformation(here, there).TransformPoints(degrees[:, ::-1].tolist())
    ]
    # Without ReadAsArray, which asks for the numpy that gdal was built with.
    return np.array(
        [
            [np.frombuffer(file.GetRasterBand(band).ReadRaster(int(x), int(y), 1, 1), np.float32)[0] for x, y in places]
            for band in (1, 2)
        ]
    )


@pytest.mark.parametrize(("crs", "code"), [("", "32631"), ("EPSG:25831", "25831"), ("EPSG:4326", "4326")])
def test_a_geotiff_lies_where_the_map_does(tmp_path, stored, crs, code):
    pytest.importorskip("rasterio", reason="rasterio is not installed")
    export(stored, tmp_path / "map.tif", ExportOptions(crs=crs))
    told = described(tmp_path / "map.tif")
    assert f'ID["EPSG",{code}]' in told["coordinateSystem"]["wkt"].replace(" ", "")
    assert [band["description"] for band in told["bands"]] == ["highest point [m]", "number of points"]
    strongest = stored.shown.take(np.argsort(stored.shown.count)[-20:])
    heights, points = looked_up(tmp_path / "map.tif", code, ORIGIN.degrees(strongest.centers))
    np.testing.assert_allclose(heights, -2.0)
    # A pixel may take its neighbour's number.
    assert np.median(points / strongest.count) > 0.8


def test_a_map_that_is_nowhere_keeps_its_own_coordinates(tmp_path):
    pytest.importorskip("rasterio", reason="rasterio is not installed")
    write_geotiff(tmp_path / "map.tif", map_with([[-0.4, 0.1, -2.0, 1.0], [0.1, 0.6, -3.0, 1.0]], RESOLUTION).blocks)
    told = described(tmp_path / "map.tif")
    assert told["geoTransform"] == [-0.5, 0.5, 0.0, 1.0, 0.0, -0.5]
    assert told["size"] == [2, 2]


@pytest.mark.parametrize(
    ("origin", "crs", "told"), [(None, "EPSG:25831", "map_bag --origin"), (ORIGIN, "EPSG:2", "not known")]
)
def test_coordinates_that_cannot_be_had_are_refused(tmp_path, blocks, origin, crs, told):
    pytest.importorskip("rasterio", reason="rasterio is not installed")
    with pytest.raises(ExportError, match=told):
        write_geotiff(tmp_path / "map.tif", blocks, origin, crs)


def test_tiles_show_the_surface_at_its_place_in_every_zoom(tmp_path, blocks):
    pytest.importorskip("rasterio", reason="rasterio is not installed")
    written = write_tiles(tmp_path, blocks, ORIGIN)
    zooms = sorted(int(folder.name) for folder in tmp_path.iterdir())
    assert len(list(tmp_path.glob("*/*/*.png"))) == written
    assert zooms == list(range(zooms[0], 19))
    assert len(list((tmp_path / str(zooms[0])).glob("*/*.png"))) == 1
    latitude, longitude = np.radians(ORIGIN.degrees(np.array([[EAST_WALL / 2.0, NORTH_WALL / 2.0]]))[0])
    for zoom in zooms:
        # The formula of OpenStreetMap's "slippy map tilenames".
        x = 2.0**zoom * (longitude / np.pi + 1.0) / 2.0
        y = 2.0**zoom * (1.0 - np.log(np.tan(latitude) + 1.0 / np.cos(latitude)) / np.pi) / 2.0
        with Image.open(str(tmp_path / str(zoom) / str(int(x)) / f"{int(y)}.png")) as image:
            column, row = int(x % 1.0 * 256), int(y % 1.0 * 256)
            near = np.asarray(image)[max(row - 3, 0) : row + 4, max(column - 3, 0) : column + 4]
        assert near[..., 3].max() == 255, zoom


def test_a_thick_band_of_points_is_drawn_as_one_thin_line(blocks):
    lines = ridges(blocks)
    middle = lines.mean(axis=1)
    along = np.array([EAST_WALL, NORTH_WALL]) / np.hypot(EAST_WALL, NORTH_WALL)
    inner = (middle @ along > 5.0) & (middle @ along < 65.0)
    off = middle[inner] @ [-along[1], along[0]]
    assert np.abs(off).max() < 0.7
    assert np.sqrt(np.mean(off**2)) < 0.3
    directions = lines[inner, 1] - lines[inner, 0]
    assert np.median(np.abs(directions @ along) / np.hypot(*directions.T)) > 0.98
    starts, ends = np.sort(lines[inner] @ along, axis=1)[np.argsort((lines[inner] @ along).min(axis=1))].T
    assert (starts[1:] - np.maximum.accumulate(ends)[:-1]).max() < RESOLUTION


def test_a_post_has_no_line_nor_has_a_map_without_blocks():
    post = wall([(0.0, 0.0), (0.01, 0.0)], spread=0.2)
    assert ridges(post).shape == ridges(post.take(np.zeros(0, dtype=int))).shape == (0, 2, 2)


def test_a_map_of_wide_water_is_looked_at_in_larger_cells():
    far = map_with([[-5000.0, -5000.0, 0.0, 1.0], [5000.0, 5000.0, 0.0, 1.0]], RESOLUTION).blocks
    numbers, low, side = counts(far)
    assert numbers.size < 17_000_000
    row, column = np.argwhere(numbers)[-1]
    np.testing.assert_allclose((np.array([column, row]) + low + 0.5) * side, 5000.0, atol=side)
