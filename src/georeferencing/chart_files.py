"""The path on the chart: GeoJSON (RFC 7946), KML (OGC 07-147r2) and a table."""

import json
from pathlib import Path
from xml.sax.saxutils import escape

import numpy as np

from georeferencing.origin import Origin
from node_support.files import write_whole

CHART_FILES = ("path.geojson", "path.kml", "path.csv")
_DIGITS = 8  # of degrees: a millimetre


def write_chart(folder: Path, name: str, origin: Origin, times: np.ndarray, path: np.ndarray) -> None:
    """Write a path (m, >= 2) x y [m] at `times` (m,) s, each file whole or not at all; raises OSError."""
    degrees = np.round(origin.degrees(path), _DIGITS)
    longitude_first = degrees[:, ::-1]
    write_whole(folder / "path.geojson", _geojson(name, times, longitude_first))
    write_whole(folder / "path.kml", _kml(name, longitude_first))
    rows = np.column_stack([times, degrees])
    text = "time,latitude,longitude\n" + "%.6f,%.8f,%.8f\n" * len(rows) % tuple(rows.ravel().tolist())
    write_whole(folder / "path.csv", text.encode("ascii"))


def _geojson(name: str, times: np.ndarray, longitude_first: np.ndarray) -> bytes:
    feature = {
        "type": "Feature",
        "properties": {"name": name, "times": np.round(times, 3).tolist()},
        "geometry": {"type": "LineString", "coordinates": longitude_first.tolist()},
    }
    return (json.dumps({"type": "FeatureCollection", "features": [feature]}) + "\n").encode()


def _kml(name: str, longitude_first: np.ndarray) -> bytes:
    points = " ".join(f"{longitude:.8f},{latitude:.8f},0" for longitude, latitude in longitude_first.tolist())
    return (
        '<?xml version="1.0" encoding="UTF-8"?>\n<kml xmlns="http://www.opengis.net/kml/2.2"><Document><Placemark>'
        f"<name>{escape(name)}</name><LineString><tessellate>1</tessellate><coordinates>{points}</coordinates>"
        "</LineString></Placemark></Document></kml>\n"
    ).encode()
