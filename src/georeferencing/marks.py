"""Named places of the map as GeoJSON (RFC 7946)."""

import json
from typing import Optional, Sequence

import numpy as np

from georeferencing.origin import Origin
from node_support.marks import Mark

_DIGITS = 8  # of degrees: a millimetre


def marks_geojson(marks: Sequence[Mark], origin: Optional[Origin]) -> bytes:
    """Return the marks by longitude and latitude; in metres of the map, which the file says, without an origin.

    The properties of each mark hold its place in the map, x, y and z [m], too.
    """
    places = np.array([(mark.x, mark.y, mark.z) for mark in marks], dtype=np.float64).reshape(-1, 3)
    shown = places[:, :2] if origin is None else np.round(origin.degrees(places)[:, ::-1], _DIGITS)
    features = [
        {
            "type": "Feature",
            "properties": {"name": mark.name, "x": mark.x, "y": mark.y, "z": mark.z},
            "geometry": {"type": "Point", "coordinates": place},
        }
        for mark, place in zip(marks, shown.tolist())
    ]
    told = {} if origin is not None else {"coordinates": "metres of the map, x and y; its origin is not known"}
    return (json.dumps({"type": "FeatureCollection", **told, "features": features}, ensure_ascii=False) + "\n").encode()
