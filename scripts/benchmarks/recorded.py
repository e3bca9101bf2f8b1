"""Where the real recordings are, which are not part of the repository."""

import os
from pathlib import Path

from recordings.beams import RecordedBeams
from recordings.motion.vehicle_motion import MotionNames, MotionSource
from recordings.reader import Request, read

ROOT = Path(__file__).resolve().parents[2]


def recorded(name: str) -> Path:
    """Return the path of a recording, which may be missing: in the folder UMC_DATA, or beside the repository."""
    return Path(os.environ.get("UMC_DATA", str(ROOT.parent / "shared/data"))) / name


def recorded_beams(name: str) -> RecordedBeams:
    """Return the beams of a recording of a vehicle at rest. Raises RecordingError."""
    return read(recorded(name), Request(motion=MotionNames(declared=MotionSource.STANDING))).recorded
