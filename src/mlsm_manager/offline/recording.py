"""What a bag holds, as the cores take it."""

from dataclasses import dataclass, field, replace
from typing import Iterator, List, Optional, Tuple

import numpy as np

from mlsm_manager.scan_matching.scan import Scan, Track
from node_support.errors import RefusedInput
from node_support.geometry import composed, inverse, matrices, transformed
from sonar_processing.beams.beam import PlacedBeam
from sonar_processing.beams.parameters import BeamCorrection
from sonar_processing.filters.echo_extractor import EchoExtractor, EchoExtractorParameters
from sonar_processing.scans.assembler import RevolutionCollector
from sonar_processing.scans.parameters import SonarToCloudParameters
from sonar_processing.scans.polar_scan import PolarScan

# s of odometry around the end of a scan: the slowest turn of a head, and the largest sonar_delay.
_BEFORE = 60.0
_AFTER = 10.0


@dataclass(frozen=True)
class Truth:
    """Where the vehicle was by another instrument. times: (t,) s, increasing. positions: (t, 2) x y [m]."""

    times: np.ndarray
    positions: np.ndarray


@dataclass(frozen=True)
class Recording:
    """beams: in the order of their stamps, placed in odom. unplaced: number of beams that tf could not place.

    track: T_odom_base over the whole recording. seconds: its length. notes: what was assumed, as sentences.
    """

    beams: List[PlacedBeam]
    unplaced: int
    track: Track
    truth: Optional[Truth]
    notes: List[str] = field(default_factory=list)

    def corrected(self, correction: BeamCorrection) -> "Recording":
        """Return the recording with all beams corrected, each placed by the odometry at its new stamp.

        Beams that the track does not reach then count as unplaced; depth and tilt of the others stay.
        """
        if correction == BeamCorrection():
            return self
        times = np.array([placed.beam.stamp_ns for placed in self.beams]) * 1e-9
        later = times + correction.sonar_delay
        reached = (later >= self.track.times[0]) & (later <= self.track.times[-1])
        moves = matrices(composed(self.track.at(later), inverse(self.track.at(times))))
        beams = [
            PlacedBeam(correction.corrected(placed.beam), move @ placed.T_target_sonar, placed.is_moving)
            for placed, move, kept in zip(self.beams, moves, reached)
            if kept
        ]
        return replace(self, beams=beams, unplaced=self.unplaced + len(self.beams) - len(beams))

    @property
    def sonar_in_base(self) -> np.ndarray:
        """(2,) x y [m] of the sonar in base_link, from the first beam."""
        first = self.beams[0]
        pose = self.track.at(first.beam.stamp_ns * 1e-9)
        return transformed(inverse(pose), first.T_target_sonar[np.newaxis, :2, 3])[0]

    @property
    def seconds(self) -> float:
        """From the first to the last of what was recorded, s."""
        return float(self.track.times[-1] - self.track.times[0])


def scans_of(recording: Recording, echoes: EchoExtractorParameters) -> Iterator[Tuple[Scan, int]]:
    """Yield one scan of echoes per turn of the head, with its number of beams.

    Its track begins a minute before its end, or where the scan before ended if that was earlier, and reaches 10 s
    beyond, for stamps that are to be moved.
    """
    collector, extractor, cloud = RevolutionCollector(), EchoExtractor(echoes), SonarToCloudParameters()
    before = np.inf
    for placed in recording.beams:
        turn = collector.add(placed)
        if turn is None:
            continue
        try:
            found = extractor(PolarScan.of(turn).cloud(cloud))
        except RefusedInput:
            continue
        end = found.stamp_ns * 1e-9
        track = track_between(recording.track, min(end - _BEFORE, before), end + _AFTER)
        before = end
        yield Scan.from_stamps(found.points, found.time_stamps, end, track), len(turn)


def track_between(track: Track, start: float, end: float) -> Track:
    """Return the part of a track that covers the times `start` to `end` [s], as far as it reaches."""
    first = max(int(np.searchsorted(track.times, start, side="right")) - 1, 0)
    last = min(int(np.searchsorted(track.times, end)) + 1, len(track.times))
    return Track(track.times[first:last], track.poses[first:last])
