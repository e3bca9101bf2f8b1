"""Beams of the `.852` logs of Imagenex."""

from os.path import getmtime
from pathlib import Path

import numpy as np

from imagenex_852_driver.logs.log_file import LogReader
from imagenex_852_driver.logs.playback import timed
from imagenex_852_driver.protocol.angles import head_angle
from recordings.beams.found_beams import FoundBeams
from recordings.errors import RecordingError
from sonar_processing.beams.beam import Beam

FRAME = "sonar"


def imagenex_beams(path: Path) -> FoundBeams:
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
            angle = head_angle(ping.reply.head_position, ping.transducer_up)
            strengths = np.frombuffer(ping.reply.echoes, dtype=np.uint8)
            stamp = round((start + moment) * 1e9)
            beams.append(Beam(stamp, FRAME, angle, strengths, ping.reply.range_resolution))
    if not pings:
        raise RecordingError(f"{path}: not a .852 log, no ping in it")
    notes = [] if stamped else [f"{path.name} states no time: the first ping counts as taken when the file was written"]
    return FoundBeams(beams, [False] * len(beams), pings - len(beams), notes)
