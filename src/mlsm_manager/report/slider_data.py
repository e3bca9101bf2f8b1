"""The scans behind the slider, packed so that hundreds of them stay small in a page."""

import base64
import json
from typing import Dict, List

import numpy as np

from mlsm_manager.report.mission import Mission

_MOST_POINTS = 800  # of a scan: more cannot be told apart on a screen
_UNIT = 0.01  # m: points are stored as whole centimetres from the vehicle
_FARTHEST = np.iinfo(np.int16).max * _UNIT


def slider_json(mission: Mission) -> str:
    """Return the JSON that the page's script reads: time, vehicle and points of each scan.

    Points are little-endian int16 x y in hundredths of a metre from the vehicle, in base64.
    """
    best = mission.best
    scans: List[Dict[str, object]] = []
    for scan in mission.scans:
        vehicle = [float(np.interp(scan.time, best.times, best.poses[:, axis])) for axis in (0, 1)]
        scans.append(
            {
                "time": round(scan.time - mission.start, 1),
                "vehicle": [round(value, 2) for value in vehicle],
                "echoes": len(scan.points),
                "rejection": scan.rejection,
                "points": _packed(scan.points[:, :2] - vehicle),
            }
        )
    # A page may hold no "</" inside a script.
    return json.dumps({"unit": _UNIT, "scans": scans}).replace("</", "<\\/")


def _packed(points: np.ndarray) -> str:
    step = max(1, -(-len(points) // _MOST_POINTS))
    near = np.clip(points[::step], -_FARTHEST, _FARTHEST)
    return base64.b64encode(np.round(near / _UNIT).astype("<i2").tobytes()).decode("ascii")
