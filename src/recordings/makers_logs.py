"""Beams of the logs of sonars' makers: `.852` files of Imagenex, and what Ping Viewer writes of a Ping360."""

from os.path import getmtime
from pathlib import Path
from typing import Callable, Iterator, Optional, Tuple

import numpy as np

from imagenex_852_driver.log_file import LogReader, timed
from imagenex_852_driver.protocol.reply import head_angle as imagenex_angle
from ping360_driver.ping_viewer_log import NoLogError, PingViewerLog
from ping360_driver.protocol.messages import MessageError, MessageId, MessageStream
from ping360_driver.protocol.replies import Beam as HeadBeam
from ping360_driver.protocol.replies import beam as head_beam
from ping360_driver.protocol.scan_command import bin_length
from ping360_driver.protocol.scan_command import head_angle as ping360_angle
from recordings.bags.bag import RecordingError
from recordings.beams import RecordedBeams
from sonar_processing.beams.beam import Beam
from sonar_processing.messages.beam_types import USUAL_SPEED_OF_SOUND

_FRAME = "sonar"
_BEAMS = (MessageId.DEVICE_DATA, MessageId.AUTO_DEVICE_DATA)
_Reader = Callable[[Path], RecordedBeams]


def is_makers_log(path: Path) -> bool:
    """Return whether a file is a log that is read here: .852 by its name, Ping Viewer's by its first bytes."""
    return _reader(path) is not None


def makers_beams(path: Path) -> RecordedBeams:
    """Return the beams of a log, in the frame "sonar". Raises RecordingError."""
    reader = _reader(path)
    if reader is None:
        raise RecordingError(f"{path}: not a log of a known sonar: neither a .852 file nor a log of Ping Viewer")
    return reader(path)


def _reader(path: Path) -> Optional[_Reader]:
    if path.suffix.lower() == ".852":
        return _imagenex_beams
    return _ping_viewer_beams if path.is_file() and _is_ping_viewer_log(path) else None


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


def _is_ping_viewer_log(path: Path) -> bool:
    """Return whether a file begins as a log of Ping Viewer does; False for one that cannot be read."""
    try:
        with path.open("rb") as file:
            PingViewerLog(file.read(4096))
    except (OSError, NoLogError):
        return False
    return True


def _ping_viewer_beams(path: Path) -> RecordedBeams:
    """Return the beams of a log. Raises RecordingError.

    A beam was taken before its message came, by as long as the head listened. Messages that are not whole or hold
    nothing count as refused.
    """
    try:
        log = PingViewerLog(path.read_bytes())
    except OSError as error:
        raise RecordingError(f"{path}: {error.strerror}") from None
    except NoLogError as error:
        raise RecordingError(f"{path}: not a log of Ping Viewer: {error}") from None
    stream = MessageStream()
    beams, inconsistent = [], 0
    for time, found in _messages(log, stream):
        if found is None:
            inconsistent += 1
            continue
        stamp = max(round((time - found.pulse.listening_time) * 1e9), 1)
        resolution = bin_length(found.pulse.sample_period, USUAL_SPEED_OF_SOUND)
        strengths = np.frombuffer(found.echoes, dtype=np.uint8)
        beams.append(Beam(stamp, _FRAME, ping360_angle(found.angle), strengths, resolution))
    if not beams:
        raise RecordingError(f"{path}: no beam of a Ping360 in this log")
    note = f"times of {path.name} count from the start of Ping Viewer; ranges are those of {USUAL_SPEED_OF_SOUND:g} m/s"
    return RecordedBeams(beams, [False] * len(beams), log.damaged + stream.broken + inconsistent, [note])


def _messages(log: PingViewerLog, stream: MessageStream) -> Iterator[Tuple[float, Optional[HeadBeam]]]:
    """Yield the beams with the times of their messages; None for one that is inconsistent."""
    for part in log:
        for parsed in stream.feed(part.data):
            if parsed.message.message_id in _BEAMS:
                try:
                    found = head_beam(parsed.message)
                    yield part.time, found if found.echoes else None
                except MessageError:
                    yield part.time, None
