"""The logs of sonars' makers."""

from pathlib import Path
from typing import Callable, Optional

from recordings.beams.found_beams import FoundBeams
from recordings.beams.imagenex_log import imagenex_beams
from recordings.beams.ping_viewer_beams import is_ping_viewer_log, ping_viewer_beams
from recordings.errors import RecordingError

_Reader = Callable[[Path], FoundBeams]


def is_makers_log(path: Path) -> bool:
    """Return whether a file is a log that is read here: .852 by its name, Ping Viewer's by its first bytes."""
    return _reader(path) is not None


def makers_beams(path: Path) -> FoundBeams:
    """Return the beams of a log, in the frame "sonar". Raises RecordingError."""
    reader = _reader(path)
    if reader is None:
        raise RecordingError(f"{path}: not a log of a known sonar: neither a .852 file nor a log of Ping Viewer")
    return reader(path)


def _reader(path: Path) -> Optional[_Reader]:
    if path.suffix.lower() == ".852":
        return imagenex_beams
    return ping_viewer_beams if path.is_file() and is_ping_viewer_log(path) else None
