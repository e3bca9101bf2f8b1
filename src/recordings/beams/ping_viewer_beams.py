"""Beams of the logs that Ping Viewer writes of a Ping360."""

from pathlib import Path
from typing import Iterator, Optional, Tuple

import numpy as np

from ping360_driver.logs.ping_viewer_log import NoLogError, PingViewerLog
from ping360_driver.protocol.angles import head_angle
from ping360_driver.protocol.message_stream import MessageStream
from ping360_driver.protocol.messages import MessageError, MessageId
from ping360_driver.protocol.replies import Beam as HeadBeam
from ping360_driver.protocol.replies import beam as head_beam
from ping360_driver.protocol.sampling import bin_length
from recordings.beams.found_beams import FoundBeams
from recordings.errors import RecordingError
from sonar_processing.beams.beam import Beam
from sonar_processing.messages.fields import USUAL_SPEED_OF_SOUND

FRAME = "sonar"
_BEAMS = (MessageId.DEVICE_DATA, MessageId.AUTO_DEVICE_DATA)


def is_ping_viewer_log(path: Path) -> bool:
    """Return whether a file begins as a log of Ping Viewer does; False for one that cannot be read."""
    try:
        with path.open("rb") as file:
            PingViewerLog(file.read(4096))
    except (OSError, NoLogError):
        return False
    return True


def ping_viewer_beams(path: Path) -> FoundBeams:
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
        beams.append(Beam(stamp, FRAME, head_angle(found.angle), strengths, resolution))
    if not beams:
        raise RecordingError(f"{path}: no beam of a Ping360 in this log")
    note = f"times of {path.name} count from the start of Ping Viewer; ranges are those of {USUAL_SPEED_OF_SOUND:g} m/s"
    return FoundBeams(beams, [False] * len(beams), log.damaged + stream.broken + inconsistent, [note])


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
