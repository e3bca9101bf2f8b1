"""Beams in tables, with a row for each."""

from pathlib import Path
from typing import Dict, List

import numpy as np

from node_support.errors import RefusedInput
from recordings.bags.bag import RecordingError
from recordings.beams import RecordedBeams
from recordings.motion.motion_table import is_table, rows_of
from sonar_processing.beams.beam import Beam

_ANGLES = {"angle": 1.0, "angle_deg": np.pi / 180.0}  # rad
_FRAME = "sonar"


def is_beam_table(path: Path) -> bool:
    """Return whether a file is a table with a column of bins."""
    if not is_table(path):
        return False
    try:
        return "bins" in next(rows_of(path), [])
    except RecordingError:
        return False


def beams_of_table(path: Path) -> RecordedBeams:
    """Return the beams of a table as docs/sonars.md describes it. Raises RecordingError for one without a column."""
    names, *rows = rows_of(path)
    angle = next((name for name in _ANGLES if name in names), "angle")
    missing = [name for name in ("time", angle, "range") if name not in names]
    if missing or names[-1] != "bins":
        raise RecordingError(f"{path}: has the columns {', '.join(names)}; needs time, angle, range and, last, bins")
    beams, refused, reason = [], 0, ""
    for line, row in enumerate(rows, start=2):
        try:
            beams.append(_beam(dict(zip(names, row)), angle, row[len(names) - 1 :]))
        except (RefusedInput, ValueError, KeyError, OverflowError) as error:
            refused, reason = refused + 1, reason or f"line {line}: {error}"
    notes = [f"{refused} rows of {path.name} hold no beam, the first is {reason}"] if refused else []
    return RecordedBeams(beams, [False] * len(beams), refused, notes)


def _beam(cells: Dict[str, str], angle: str, bins: List[str]) -> Beam:
    """Return the beam of a row. Raises RefusedInput, ValueError and KeyError for a row that holds none."""
    strengths = np.clip([float(value) for value in " ".join(bins).split()], 0, 255).astype(np.uint8)
    length = float(cells["range"]) / max(strengths.size, 1)
    return Beam(round(float(cells["time"]) * 1e9), _FRAME, float(cells[angle]) * _ANGLES[angle], strengths, length)
