"""Beams of logs: `.852` files of Imagenex, what both Ping Viewers write of a Ping360, and tables."""

from contextlib import suppress
from os.path import getmtime
from pathlib import Path
from typing import Callable, Dict, Iterator, List, Optional, Tuple

import numpy as np

from imagenex_852_driver.log_file import LogReader, timed
from imagenex_852_driver.reply import head_angle as imagenex_angle
from node_support.errors import RefusedInput
from node_support.headers import check_stamp
from ping360_driver.messages import MessageError, MessageId, MessageStream, PingMessage
from ping360_driver.ping_viewer_log import NoLogError, PingViewerLog
from ping360_driver.scan_command import Beam as HeadBeam
from ping360_driver.scan_command import beam as head_beam
from ping360_driver.scan_command import bin_length
from ping360_driver.scan_command import head_angle as ping360_angle
from recordings.bags.bag import RecordingError, first_bytes
from recordings.beams import RecordedBeams
from recordings.motion.motion_table import is_table, rows_of
from recordings.ping_viewer_next import head_beams, is_ping_viewer_next
from sonar_processing.beams.beam import Beam
from sonar_processing.beams.beam_fields import USUAL_SPEED_OF_SOUND

_FRAME = "sonar"
_BEAMS = (MessageId.DEVICE_DATA, MessageId.AUTO_DEVICE_DATA)
_SOUNDINGS = (MessageId.SOUNDING, MessageId.SOUNDING_PROFILE)
_SURE = 50  # %: confidence of an echo sounder (ping1d) from which on its distance counts
_BEGINNING = 20480  # bytes: two parts of the longest that Ping Viewer writes; the first may be damaged
_Reader = Callable[[Path], RecordedBeams]


def is_makers_log(path: Path) -> bool:
    """Return whether a file is a log that is read here: .852 by its name, Ping Viewer's by its first bytes,
    a table by its columns.
    """
    return _reader(path) is not None


def makers_beams(path: Path) -> RecordedBeams:
    """Return the beams of a log that is read here, in the frame "sonar". Raises RecordingError."""
    return _reader(path)(path)


def _reader(path: Path) -> Optional[_Reader]:
    if path.suffix.lower() == ".852":
        return _imagenex_beams
    if is_ping_viewer_next(path):
        return _ping_viewer_next_beams
    with suppress(RecordingError):
        if is_table(path) and "bins" in next(rows_of(path)):
            return _beams_of_table
    if path.is_file():
        with suppress(NoLogError):
            PingViewerLog(first_bytes(path, _BEGINNING))
            return _ping_viewer_beams
    return None


def _imagenex_beams(path: Path) -> RecordedBeams:
    """Return the beams of a log at the times that it states, or from the time of the file on where it states none.

    Pings without echoes count as refused. Raises RecordingError.
    """
    try:
        reader = LogReader(path)
        start = getmtime(str(path))
    except OSError as error:
        raise RecordingError(f"{path}: {error.strerror}") from None
    beams, pings, stamped = [], 0, False
    for moment, ping in timed(reader):
        if not pings and ping.stamp is not None:
            start, stamped = ping.stamp, True
        pings += 1
        if ping.reply.echoes:
            angle = imagenex_angle(ping.reply.head_position, ping.transducer_up)
            strengths = np.frombuffer(ping.reply.echoes, dtype=np.uint8)
            stamp = round((start + moment) * 1e9)
            beams.append(Beam(stamp, _FRAME, angle, strengths, ping.reply.range_resolution))
    if not pings:
        raise RecordingError(f"{path}: not a .852 log, no ping in it")
    notes = [] if stamped else [f"{path.name} states no time: the first ping counts as taken when the file was written"]
    return RecordedBeams(beams, [False] * len(beams), pings - len(beams), notes)


def _ping_viewer_beams(path: Path) -> RecordedBeams:
    """Return the beams of a log. Raises RecordingError.

    A beam was taken before its message came, by as long as the head listened. Messages that are not whole or hold
    nothing count as refused.
    """
    try:
        log, stream = PingViewerLog(path.read_bytes()), MessageStream()
    except OSError as error:
        raise RecordingError(f"{path}: {error.strerror}") from None
    heads: Dict[int, List[Tuple[Beam, int]]] = {}
    soundings: List[Tuple[float, float]] = []
    inconsistent = 0
    for time, message in _messages(log, stream):
        if message.message_id in _SOUNDINGS:
            soundings += [(time, 1e-3 * message.distance)] if message.confidence >= _SURE else []
            continue
        try:
            found = head_beam(message)
            beam = _beam_of(found, time - found.pulse.listening_time)
        except (MessageError, RefusedInput):
            inconsistent += 1
            continue
        heads.setdefault(message.src_device_id, []).append((beam, found.pulse.gain_setting))
    refused = log.damaged + stream.broken + inconsistent
    if not heads:
        raise RecordingError(f"{path}: none of its messages is a beam of a Ping360; {refused} were damaged or empty")
    notes = [
        f"times of {path.name} count from the start of Ping Viewer; ranges are those of {USUAL_SPEED_OF_SOUND:g} m/s"
    ]
    device, heard = max(heads.items(), key=lambda one: len(one[1]))
    beams, gains = map(list, zip(*heard))
    if len(heads) > 1:
        counts = ", ".join(f"{len(kept)} of device {number}" for number, kept in sorted(heads.items()))
        notes.append(f"{path.name} holds the beams of several heads, {counts}: only those of device {device} are used")
    if soundings:
        notes.append(f"an echo sounder beside the Ping360 told {len(soundings)} distances below")
    return RecordedBeams(beams, [False] * len(beams), refused, notes, np.array(soundings).reshape(-1, 2), gains)


def _ping_viewer_next_beams(path: Path) -> RecordedBeams:
    """Return the beams of a recording of Ping Viewer Next. Raises RecordingError."""
    found, refused, notes = head_beams(path)
    beams = []
    for time, beam in found:
        try:
            beams.append(_beam_of(beam, time - beam.pulse.listening_time))
        except RefusedInput:
            refused += 1
    notes.append(f"ranges of {path.name} are those of {USUAL_SPEED_OF_SOUND:g} m/s")
    return RecordedBeams(beams, [False] * len(beams), refused, notes)


def _messages(log: PingViewerLog, stream: MessageStream) -> Iterator[Tuple[float, PingMessage]]:
    """Yield the messages of beams and of distances below with the times at which they came, s."""
    for part in log:
        for parsed in stream.feed(part.data):
            if parsed.message.message_id in _BEAMS + _SOUNDINGS:
                yield part.time, parsed.message


def _beam_of(found: HeadBeam, time: float) -> Beam:
    """Return what the head sent at `time` [s]. Raises RefusedInput where it holds no echoes, or at no time of ROS."""
    stamp = max(round(time * 1e9), 1)
    check_stamp(stamp)
    resolution = bin_length(found.pulse.sample_period, USUAL_SPEED_OF_SOUND)
    return Beam(stamp, _FRAME, ping360_angle(found.angle), np.frombuffer(found.echoes, dtype=np.uint8), resolution)


_ANGLES = {"angle": 1.0, "angle_deg": np.pi / 180.0}  # rad


def _beams_of_table(path: Path) -> RecordedBeams:
    """Return the beams of a table as docs/sonars.md describes it. Raises RecordingError for one without a column."""
    names, *rows = rows_of(path)
    angle = next((name for name in _ANGLES if name in names), "angle")
    missing = [name for name in ("time", angle, "range") if name not in names]
    if missing or names[-1] != "bins":
        raise RecordingError(f"{path}: has the columns {', '.join(names)}; needs time, angle, range and, last, bins")
    beams, refused, reason = [], 0, ""
    for line, row in enumerate(rows, start=2):
        cells, bins = dict(zip(names, row)), row[len(names) - 1 :]
        try:
            strengths = np.clip([float(value) for value in " ".join(bins).split()], 0, 255).astype(np.uint8)
            length = float(cells["range"]) / max(strengths.size, 1)
            stamp = round(float(cells["time"]) * 1e9)
            beams.append(Beam(stamp, _FRAME, float(cells[angle]) * _ANGLES[angle], strengths, length))
        except (RefusedInput, ValueError, KeyError, OverflowError) as error:
            refused, reason = refused + 1, reason or f"line {line}: {error}"
    notes = [f"{refused} rows of {path.name} hold no beam, the first is {reason}"] if refused else []
    return RecordedBeams(beams, [False] * len(beams), refused, notes)
