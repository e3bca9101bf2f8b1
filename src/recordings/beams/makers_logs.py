"""The logs of sonars' makers."""

from pathlib import Path
from typing import Callable, Dict

from recordings.beams.found_beams import FoundBeams
from recordings.beams.imagenex_log import imagenex_beams

_READERS: Dict[str, Callable[[Path], FoundBeams]] = {".852": imagenex_beams}


def is_makers_log(path: Path) -> bool:
    """Return whether a file is a log that is read here, by its name."""
    return path.suffix.lower() in _READERS


def makers_beams(path: Path) -> FoundBeams:
    """Return the beams of a log, in the frame "sonar". Raises RecordingError."""
    return _READERS[path.suffix.lower()](path)
