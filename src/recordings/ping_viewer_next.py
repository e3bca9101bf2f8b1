"""Recordings of Ping Viewer Next: MCAP files with JSON messages of the devices and of the vehicle's attitude.

Source: src/device/recording and src/vehicle in bluerobotics/ping-viewer-next; no recording of it was at hand. Its
latitude and longitude are those of the autopilot's estimator (GLOBAL_POSITION_INT), 0 while that has none.
"""

import json
import re
import struct
from collections import Counter
from pathlib import Path
from types import SimpleNamespace
from typing import Any, Dict, Iterator, List, Optional, Tuple

import numpy as np

from georeferencing.fixes import Fix
from node_support.errors import needed
from node_support.geometry import pose_matrix, quaternion_of
from ping360_driver.messages import MessageError, MessageId
from ping360_driver.scan_command import Beam as HeadBeam
from ping360_driver.scan_command import beam as head_beam
from recordings.bags.bag import RecordingError, first_bytes
from recordings.bags.ros2_folder import MAGIC
from recordings.motion.pose_track import LATEST_NS, PoseTrack

_PROFILE, _ROS2 = len(MAGIC) + 1 + 8 + 4, b"ros2"  # after number and length of the header, and the profile's length
_TOPIC = re.compile(r"/?(device_[^/]+)/(Ping360|VehicleData)")
_AT_SURFACE = 1.0  # m below the highest altitude: deeper no satellite is heard, and the estimator reckons on


def is_ping_viewer_next(path: Path) -> bool:
    """Return whether a file is an MCAP file that ROS 2 has not written, by the profile in its header."""
    start = first_bytes(path, _PROFILE + len(_ROS2)) if path.suffix.lower() == ".mcap" else b""
    is_mcap = len(start) >= _PROFILE and start.startswith(MAGIC)
    return is_mcap and start[_PROFILE - 4 :] != struct.pack("<I", len(_ROS2)) + _ROS2


def head_beams(path: Path) -> Tuple[List[Tuple[float, HeadBeam]], int, List[str]]:
    """Return the beams of the head with most of them and when they came [s], how many were refused, and notes.

    Raises RecordingError.
    """
    heads: Dict[str, List[Tuple[float, HeadBeam]]] = {}
    refused = 0
    for device, time_ns, content in _messages(path, "Ping360"):
        try:
            fields = {**content, "message_id": MessageId.AUTO_DEVICE_DATA, "data": bytes(content["data"])}
            found = head_beam(SimpleNamespace(**fields))
        except (MessageError, AttributeError, KeyError, TypeError, ValueError):
            refused += 1
            continue
        heads.setdefault(device, []).append((time_ns * 1e-9, found))
    if not heads:
        raise RecordingError(f"{path}: no beam of a Ping360 on a topic device_.../Ping360; {refused} were not readable")
    device, beams = max(heads.items(), key=lambda one: len(one[1]))
    notes = [f"{path.name} holds the beams of several heads: only those of {device} are used"] if len(heads) > 1 else []
    return beams, refused, notes


def vehicle_headings(path: Path) -> Optional[PoseTrack]:
    """Return the vehicle's orientations, x north, y west, z up, at the origin; None of a file without any.

    Raises RecordingError.
    """
    if not is_ping_viewer_next(path):
        return None
    stamps, rotations = [], []
    for _, time_ns, content in _messages(path, "VehicleData"):
        angles = [content.get(name) for name in ("roll", "pitch", "yaw")]
        if time_ns < LATEST_NS and all(isinstance(angle, (int, float)) for angle in angles):
            stamps.append(time_ns)
            rotations.append(quaternion_of(pose_matrix((0.0, 0.0, 0.0), angles)))
    track = PoseTrack.sorted_from(np.array(stamps), np.zeros((len(stamps), 3)), np.array(rotations))
    return track.turned_up() if stamps else None


def vehicle_fixes(path: Path) -> List[Fix]:
    """Return where the vehicle was while at the surface; nothing of another file. Raises RecordingError."""
    if not is_ping_viewer_next(path):
        return []
    rows = []
    for _, time_ns, content in _messages(path, "VehicleData"):
        place = [content.get(name) for name in ("lat", "lon", "alt")]
        if all(isinstance(value, (int, float)) for value in place) and any(place[:2]):
            rows.append((time_ns * 1e-9, *place))
    highest = max((alt for *_, alt in rows), default=0.0)
    return [Fix(time, lat, lon) for time, lat, lon, alt in rows if alt > highest - _AT_SURFACE]


def _messages(path: Path, name: str) -> Iterator[Tuple[str, int, Dict[str, Any]]]:
    """Yield device, time [ns] and content of each message of a name; of a file that was cut off as far as it goes."""
    topics: Counter[str] = Counter()
    found = False
    for topic, time_ns, data in _records(path):
        topics[topic] += 1
        match = _TOPIC.fullmatch(topic)
        if match is None:
            continue
        found = True
        if match[2] == name:
            try:
                content = json.loads(data)
            except ValueError:
                content = {}
            yield match[1], time_ns, content
    if not found:
        raise RecordingError(
            f"{path}: not written by ROS 2 or Ping Viewer Next; its topics are {', '.join(topics) or 'none'}"
        )


def _records(path: Path) -> Iterator[Tuple[str, int, bytes]]:
    names = "mcap.records", "mcap.stream_reader"
    records, reader = (needed(one, "pip install mcap", lambda text: RecordingError(f"{path}: {text}")) for one in names)
    channels: Dict[int, str] = {}
    try:
        with path.open("rb") as file:
            for record in reader.StreamReader(file).records:
                if isinstance(record, records.Channel):
                    channels[record.id] = record.topic
                elif isinstance(record, records.Message):
                    yield channels[record.channel_id], record.log_time, record.data
    except OSError as error:
        raise RecordingError(f"{path}: {error.strerror}") from None
    except Exception:
        # The library raises almost any error where the file is damaged or was cut off.
        return
