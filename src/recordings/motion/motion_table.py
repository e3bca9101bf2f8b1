"""A table of the vehicle's motion, one row per moment."""

import csv
from pathlib import Path
from typing import Dict, Iterator, List

import numpy as np

from recordings.bags.bag import RecordingError
from recordings.motion.frame_tree import FrameTree
from recordings.motion.pose_track import FARTHEST, PoseTrack
from recordings.motion.vehicle_motion import Motion, MotionNames, MotionSource, linked

COLUMNS = {
    "time": "s, of the same clock as the beams",
    "x": "m, east or any other fixed direction",
    "y": "m, to the left of x",
    "z": "m, up",
    "yaw": "rad, counter-clockwise from x",
    "yaw_deg": "degrees, counter-clockwise from x",
    "heading_deg": "degrees, clockwise from north, as a compass counts",
    "depth": "m, down",
}
"""Columns that are read, by the names in the first line; others are left out."""
_GREATEST = {"time": 2.0**31}  # s: from there on ROS 1 has no stamps
_SUFFIXES = (".csv", ".txt", ".tsv")
_HEADINGS = {"yaw": np.asarray, "yaw_deg": np.radians, "heading_deg": lambda degrees: np.pi / 2.0 - np.radians(degrees)}
"""Columns of which one tells the yaw, and how, rad."""


def is_table(path: Path) -> bool:
    return path.suffix.lower() in _SUFFIXES


def rows_of(path: Path) -> Iterator[List[str]]:
    """Yield the names in the first line, in small letters, and then the cells of each line.

    Cells are separated by whichever of comma, semicolon and tab the first line has most of. Raises RecordingError.
    """
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            delimiter = max(",;\t", key=file.readline().count)
            file.seek(0)
            rows = csv.reader(file, delimiter=delimiter)
            yield [name.strip().lower() for name in next(rows, [])]
            yield from rows
    except (UnicodeDecodeError, csv.Error) as error:
        raise RecordingError(f"{path}: not a table: {error}") from None
    except OSError as error:
        raise RecordingError(f"{path}: {error.strerror}") from None


def motion_of_csv(path: Path, names: MotionNames) -> Motion:
    """Return the motion in a table with columns of `COLUMNS`: `time`, one of the headings, and x and y if known.

    Raises RecordingError, with path and line, for a table that cannot be used.
    """
    table = _read(path)
    headings = [name for name in _HEADINGS if name in table]
    if "time" not in table or len(headings) != 1 or ("x" in table) != ("y" in table):
        raise RecordingError(
            f"{path}: has the known columns {', '.join(table) or 'none'}; needs time, one of "
            f"{', '.join(_HEADINGS)}, and both x and y or neither"
        )
    times = table["time"]
    zeros = np.zeros(len(times))
    heights = table.get("z", -table["depth"] if "depth" in table else zeros)
    places = np.column_stack([table.get("x", zeros), table.get("y", zeros), heights])
    yaws = _HEADINGS[headings[0]](table[headings[0]])
    turns = np.column_stack([zeros, zeros, np.sin(yaws / 2.0), np.cos(yaws / 2.0)])
    track = PoseTrack.sorted_from(np.round(times * 1e9).astype(np.int64), places, turns)
    source = MotionSource.POSES if "x" in table else MotionSource.HEADING
    tree = linked(FrameTree(), names, names.upward(track))
    return Motion(tree, source, [f"{source.value} from {path.name}: {len(track)} rows"])


def _read(path: Path) -> Dict[str, np.ndarray]:
    names, *rows = rows_of(path)
    kept = [(index, name) for index, name in enumerate(names) if name in COLUMNS]
    lines = [(number, row) for number, row in enumerate(rows, start=2) if any(row)]
    if len(lines) < 2:
        raise RecordingError(f"{path}: {len(lines)} rows; needs at least 2")
    values = np.array([[_number(path, line, row, index, name) for index, name in kept] for line, row in lines])
    return {name: values[:, column] for column, (_, name) in enumerate(kept)}


def _number(path: Path, line: int, row: List[str], index: int, name: str) -> float:
    text = row[index].strip() if index < len(row) else ""
    try:
        value = float(text)
    except ValueError:
        value = np.nan
    if not abs(value) <= _GREATEST.get(name, FARTHEST):
        raise RecordingError(f"{path}, line {line}: {name} = {text!r}, must be a number")
    return value
