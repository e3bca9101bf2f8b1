"""Further recordings of the same water: each starts in the map of those before, finds itself, and adds to it."""

from dataclasses import dataclass
from pathlib import Path
from typing import Dict, List, Optional, Tuple

import numpy as np

from mlsm_manager.offline.recording import Recording, read_recording, scans_of, whole_turns
from mlsm_manager.offline.replay import CORRECTED, Replayed, ReplayParameters
from mlsm_manager.report.mission import Path as Trajectory
from mlsm_manager.scan_matching.scan import Scan
from recordings.reader import Request
from sonar_processing.beams.parameters import BeamCorrection
from sonar_processing.filters.echo_extractor import EchoExtractor

_SHOWN_AFTER = 3.0
"""s after the end of a scan at which its correction is shown: it waits for odometry and is blended in."""


@dataclass(frozen=True)
class Session:
    """bag: its file. replayed: what came of it in the map of those before, in which the vehicle is searched first."""

    bag: Path
    replayed: Replayed

    def to_mapping(self) -> Dict[str, object]:
        return {
            "bag": self.bag.name,
            "scans": len(self.replayed.updates),
            "matched": self.replayed.matched,
            "rejected": self.replayed.rejected,
            "found_after_scans": self.scans_until_found,
        }

    def trajectory(self, color: str) -> Trajectory:
        """Return the vehicle's path since the first scan was found in the map; empty where none was."""
        found, replayed = self.scans_until_found, self.replayed
        start = np.inf if found is None else replayed.updates[found].scan.reference_time + _SHOWN_AFTER
        known = replayed.times >= start
        return Trajectory(f"{CORRECTED}, {self.bag.name}", color, replayed.times[known], replayed.corrected[known])

    @property
    def scans_until_found(self) -> Optional[int]:
        """Number of scans before the first that was found; None where none was, and nothing was added to the map."""
        accepted = [index for index, update in enumerate(self.replayed.updates) if update.accepted]
        return accepted[0] if accepted else None


def prepared(bag: Path, request: Request, parameters: ReplayParameters) -> Tuple[Recording, List[Scan]]:
    """Return the corrected recording and its scans. Raises RecordingError and OSError."""
    recording = read_recording(bag, request).corrected(parameters.part(BeamCorrection))
    scans = scans_of(recording, EchoExtractor(parameters.echoes()))
    return recording, whole_turns(bag, len(recording.beams), scans)
