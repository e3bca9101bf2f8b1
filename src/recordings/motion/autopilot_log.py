"""The motion in logs of an autopilot: MAVLink telemetry (.tlog) and ArduPilot's DataFlash (.BIN), by pymavlink.

Sources: common.xml of MAVLink (ATTITUDE, LOCAL_POSITION_NED, VFR_HUD); ArduPilot's log messages ATT, XKF1, NKF1, CTUN.
"""

from pathlib import Path
from typing import Any, Dict, Iterator, List, NamedTuple, Sequence, Tuple

import numpy as np

from georeferencing.fixes import UNKNOWN_DEVIATION, Fix
from node_support.errors import needed
from node_support.geometry import pose_matrix, quaternion_of
from recordings.bags.bag import RecordingError, first_bytes
from recordings.motion.frame_tree import FrameTree
from recordings.motion.pose_track import PoseTrack
from recordings.motion.vehicle_motion import Motion, MotionNames, MotionSource, linked

_TELEMETRY, _FLASH = ".tlog", (".bin", ".log")
_FLASH_START = b"\xa3\x95"  # of each message of a DataFlash log
_STILL = 0.01  # m: an estimator without a source of positions says 0, or the same


class _Fields(NamedTuple):
    """names: of fields of a message. factor: by which they become rad or m, downward. core: field of its number."""

    names: Tuple[str, ...]
    factor: float = 1.0
    core: str = ""


_DEGREES = np.pi / 180.0
_ATTITUDES = {"ATTITUDE": _Fields(("roll", "pitch", "yaw")), "ATT": _Fields(("Roll", "Pitch", "Yaw"), _DEGREES)}
_POSITIONS = {
    "LOCAL_POSITION_NED": _Fields(("x", "y", "z")),
    "XKF1": _Fields(("PN", "PE", "PD"), core="C"),
    "NKF1": _Fields(("PN", "PE", "PD"), core="C"),
}
_DEPTHS = {"VFR_HUD": _Fields(("alt",), -1.0), "CTUN": _Fields(("Alt",), -1.0)}
_FIXES, _FIX_3D = ("GPS_RAW_INT", "GPS"), 3
_KINDS = {**_ATTITUDES, **_POSITIONS, **_DEPTHS}


_Rows = List[Tuple[float, List[float]]]  # times [s] and values of the messages of one type of one vehicle


def is_autopilot_log(path: Path) -> bool:
    """Return whether a file is a log of an autopilot: telemetry by its name, DataFlash by its first bytes too."""
    ending = path.suffix.lower()
    return ending == _TELEMETRY or (ending in _FLASH and first_bytes(path, 2) == _FLASH_START)


def motion_of_autopilot(path: Path, names: MotionNames) -> Motion:
    """Return the motion in a log: attitude and the estimator's positions, or attitude and depth where it has none.

    Raises RecordingError.
    """
    rows, fixes = _rows(path)
    attitude = next((rows[kind] for kind in _ATTITUDES if kind in rows), None)
    if attitude is None:
        raise RecordingError(f"{path}: no attitude in it; it holds {', '.join(rows) or 'nothing that is known'}")
    times = np.array([time for time, _ in attitude])
    turns = np.array([quaternion_of(pose_matrix((0.0, 0.0, 0.0), angles)) for _, angles in attitude])
    kind, places = _places(rows, times)
    track = PoseTrack.sorted_from(np.round(times * 1e9).astype(np.int64), places, turns).turned_up()
    source = MotionSource.HEADING if kind in _DEPTHS or not kind else MotionSource.POSES
    known = f", positions of {kind}" if source is MotionSource.POSES else f", depth of {kind}" if kind else ""
    unused = f"; {fixes} GPS fixes, for map_bag --origin fixes" if fixes else ""
    note = f"{source.value} from {path.name}: {len(track)} attitudes{known}{unused}"
    return Motion(linked(FrameTree(), names, track), source, [note])


def fixes_of_autopilot(path: Path) -> List[Fix]:
    """Return the fixes of satellites in a log, three-dimensional ones only. Raises RecordingError."""
    fixes = []
    for message in _messages(path, _FIXES):
        if getattr(message, "fix_type", getattr(message, "Status", 0)) < _FIX_3D:
            continue
        degrees = (message.lat * 1e-7, message.lon * 1e-7) if hasattr(message, "lat") else (message.Lat, message.Lng)
        # A receiver that does not tell its accuracy [mm] sends 0, or has no such field.
        deviation = getattr(message, "h_acc", 0) * 1e-3 or UNKNOWN_DEVIATION
        fixes.append(Fix(message._timestamp, *degrees, (deviation, deviation)))
    return sorted(fixes)


def _places(rows: Dict[str, _Rows], times: np.ndarray) -> Tuple[str, np.ndarray]:
    """Return the type of messages that tell places, "" where none does, and the places (n, 3), north, east, down."""
    for kind in (*_POSITIONS, *_DEPTHS):
        if kind in rows:
            known, values = map(np.array, zip(*sorted(rows[kind], key=lambda row: row[0])))
            if kind in _DEPTHS:
                values = np.column_stack([np.zeros((len(values), 2)), values])
            elif np.ptp(values[:, :2], axis=0).max() < _STILL:
                continue
            return kind, np.column_stack([np.interp(times, known, axis) for axis in values.T])
    return "", np.zeros((len(times), 3))


def _rows(path: Path) -> Tuple[Dict[str, _Rows], int]:
    """Return the messages of the vehicle with most attitudes by type, and how many GPS fixes there are."""
    vehicles: Dict[int, Dict[str, _Rows]] = {}
    fixes = 0
    for message in _messages(path, (*_KINDS, *_FIXES)):
        kind = message.get_type()
        if kind in _FIXES:
            fixes += getattr(message, "fix_type", getattr(message, "Status", 0)) >= _FIX_3D
            continue
        fields = _KINDS[kind]
        values = [fields.factor * getattr(message, name, np.nan) for name in fields.names]
        if (fields.core and getattr(message, fields.core, 0) != 0) or not np.isfinite(values).all():
            continue
        own = vehicles.setdefault(message.get_srcSystem() if hasattr(message, "get_srcSystem") else 0, {})
        own.setdefault(kind, []).append((message._timestamp, values))
    return max(vehicles.values(), key=lambda own: max(map(len, own.values())), default={}), fixes


def _messages(path: Path, kinds: Sequence[str]) -> Iterator[Any]:
    """Yield the messages of some types. Raises RecordingError."""
    mavutil = needed("pymavlink.mavutil", "pip install pymavlink", lambda text: RecordingError(f"{path}: {text}"))
    try:
        path.open("rb").close()
        log = mavutil.mavlink_connection(str(path))
    except OSError as error:
        raise RecordingError(f"{path}: {error.strerror or error}") from None
    except Exception as error:  # pymavlink raises almost anything for a damaged index
        raise RecordingError(f"{path}: not a log of an autopilot, or damaged: {error}") from None
    try:
        while True:
            message = log.recv_match(type=list(kinds))
            if message is None:
                return
            yield message
    finally:
        log.close()
