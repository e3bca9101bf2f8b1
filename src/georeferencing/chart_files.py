"""Paths and marks on the chart: GeoJSON (RFC 7946) and KML (OGC 07-147r2)."""

import json
from dataclasses import asdict, dataclass
from typing import Any, Dict, List, Optional, Sequence
from xml.sax.saxutils import escape

import numpy as np

from georeferencing.origin import Origin
from node_support.marks import Mark

_DIGITS = 8  # of degrees: a millimetre


@dataclass(frozen=True)
class ChartedPath:
    """times: (m,) s. points: (m, >= 2) x y [m] in map."""

    name: str
    times: np.ndarray
    points: np.ndarray


def geojson(origin: Origin, path: ChartedPath, marks: Sequence[Mark]) -> bytes:
    """Return a collection of features: the path as a line with its times, and marks as points."""
    properties = {"name": path.name, "times": np.round(path.times, 3).tolist()}
    return marks_geojson(marks, origin, [_feature("LineString", _longitude_first(origin, path.points), properties)])


def marks_geojson(marks: Sequence[Mark], origin: Optional[Origin], before: Sequence[Any] = ()) -> bytes:
    """Return the features `before` and the marks as points, each with its place x, y and z [m] in the map; in metres
    of the map, which the file says, without an origin.
    """
    told = {} if origin is not None else {"coordinates": "metres of the map, x and y; its origin is not known"}
    places = _places(marks).tolist() if origin is None else _longitude_first(origin, _places(marks))
    points = [_feature("Point", place, asdict(mark)) for mark, place in zip(marks, places)]
    collection = {"type": "FeatureCollection", **told, "features": [*before, *points]}
    return (json.dumps(collection, ensure_ascii=False) + "\n").encode()


def kml(origin: Origin, path: ChartedPath, marks: Sequence[Mark]) -> bytes:
    """Return the same as placemarks."""
    line = _coordinates(_longitude_first(origin, path.points))
    placemarks = [_placemark(path.name, f"<LineString><tessellate>1</tessellate>{line}</LineString>")]
    for mark, place in zip(marks, _longitude_first(origin, _places(marks))):
        placemarks.append(_placemark(mark.name, f"<Point>{_coordinates([place])}</Point>"))
    return (
        '<?xml version="1.0" encoding="UTF-8"?>\n<kml xmlns="http://www.opengis.net/kml/2.2"><Document>'
        f"{''.join(placemarks)}</Document></kml>\n"
    ).encode()


def _places(marks: Sequence[Mark]) -> np.ndarray:
    return np.array([(mark.x, mark.y) for mark in marks]).reshape(-1, 2)


def _longitude_first(origin: Origin, points: np.ndarray) -> List[List[float]]:
    return np.round(origin.degrees(points)[:, ::-1], _DIGITS).tolist()


def _feature(kind: str, coordinates: Any, properties: Dict[str, Any]) -> Dict[str, Any]:
    geometry = {"type": kind, "coordinates": coordinates}
    return {"type": "Feature", "properties": properties, "geometry": geometry}


def _coordinates(places: List[List[float]]) -> str:
    text = " ".join(f"{longitude:.8f},{latitude:.8f},0" for longitude, latitude in places)
    return f"<coordinates>{text}</coordinates>"


def _placemark(name: str, geometry: str) -> str:
    return f"<Placemark><name>{escape(name)}</name>{geometry}</Placemark>"
