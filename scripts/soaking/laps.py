"""The vehicle's moves: the demo's tour through the basin, again and again."""

import math
from pathlib import Path
from typing import Any, Dict, List

import yaml

_BACK = {"x": 18, "y": -11, "yaw_deg": 250 - 360, "seconds": 31.6}
"""From the tour's end to its start."""


def lap_script(tour: Path, hours: float) -> str:
    """Return a script of moves, as YAML, that repeats that of the file `tour` for `hours` or a little longer."""
    script: Dict[str, Any] = yaml.safe_load(tour.read_text())
    lap: List[Dict[str, float]] = [*script["moves"], _BACK]
    seconds = sum(move.get("seconds", 0.0) + move.get("wait", 0.0) for move in lap)
    return yaml.safe_dump({"start": script["start"], "moves": lap * math.ceil(3600.0 * hours / seconds)})
