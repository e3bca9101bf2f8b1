"""Collects placed beams into scans (thesis 6.5.2)."""

from collections import deque
from dataclasses import dataclass
from typing import Deque, List, Optional, Tuple

import numpy as np

from sonar_processing.beams.beam import Beam
from sonar_processing.beams.placed_beam import PlacedBeam, servo_moved
from sonar_processing.beams.projection import kept_bins, project_beam
from sonar_processing.cloud import IntensityCloud
from sonar_processing.scans.head_turn import HeadTurn
from sonar_processing.scans.laser_pick import picked_bins
from sonar_processing.scans.parameters import SonarToCloudParameters


@dataclass(frozen=True)
class _ProjectedBeam:
    points: np.ndarray
    keep: np.ndarray
    signed_stamp: float


class ScanAssembler:
    """Turns placed beams into clouds; holds the beams of the unfinished scan and nothing else."""

    def __init__(self, parameters: SonarToCloudParameters) -> None:
        self.parameters = parameters
        self._beams: Deque[_ProjectedBeam] = deque(maxlen=parameters.scan_size)
        self._turn = HeadTurn()
        self.clear()

    def clear(self) -> None:
        """Forget the unfinished scan, because time jumped or the vehicle was carried away."""
        self._beams.clear()
        self._turn.clear()
        self._last: Optional[Beam] = None

    def project(self, placed: PlacedBeam) -> IntensityCloud:
        """Return one beam as a cloud, as it is shown while the scan grows."""
        return self._cloud([self._projected(placed)], placed.beam)

    def add(self, placed: PlacedBeam) -> Optional[IntensityCloud]:
        """Add a beam; return the scan that it completes, or None.

        A scan ends after `scan_size` beams or when the next beam is expected where the scan began. It also ends when
        the servo moved or when the last beams of a turn were lost: then the new beam belongs to the next scan. In the
        continuous modes every beam returns the newest `scan_size` beams.
        """
        finished = self._finish() if self._begins_a_scan(placed.beam) else None
        self._last = placed.beam
        self._turn.add(placed.beam.angle)
        self._beams.append(self._projected(placed))
        if self.parameters.mode.is_continuous:
            return self._cloud(list(self._beams), placed.beam)
        if finished is None and self._is_complete():
            finished = self._finish()
        return finished

    def _begins_a_scan(self, beam: Beam) -> bool:
        if self._last is None:
            return False
        return servo_moved(beam, self._last) or (self._ends_at_turn and self._turn.would_pass_start(beam.angle))

    @property
    def _ends_at_turn(self) -> bool:
        return self.parameters.end_at_full_turn and not self.parameters.mode.is_continuous

    def _is_complete(self) -> bool:
        return len(self._beams) >= self.parameters.scan_size or (self._ends_at_turn and self._turn.is_full)

    def _finish(self) -> Optional[IntensityCloud]:
        beams, last = list(self._beams), self._last
        self.clear()
        if not beams or last is None or self.parameters.mode.is_continuous:
            return None
        return self._cloud(beams, last)

    def _projected(self, placed: PlacedBeam) -> _ProjectedBeam:
        parameters, beam = self.parameters, placed.beam
        sides = 1 if parameters.mode.is_laser else parameters.dispersed_points
        points = project_beam(beam, placed.T_target_sonar, sides, parameters.beam_width)
        keep = kept_bins(np.tile(beam.ranges, sides), points[:, 2], parameters.min_range, parameters.height_limit)
        if parameters.mode.is_laser:
            points, keep = _picked(points, keep, parameters)
        return _ProjectedBeam(points, keep, placed.signed_stamp)

    def _cloud(self, beams: List[_ProjectedBeam], newest: Beam) -> IntensityCloud:
        widths = [len(beam.points) for beam in beams]
        organized = self.parameters.keep_organized and min(widths) == max(widths)
        cloud = IntensityCloud(
            points=np.concatenate([beam.points for beam in beams]),
            time_stamps=np.repeat([beam.signed_stamp for beam in beams], widths),
            stamp_ns=newest.stamp_ns,
            frame_id=self.parameters.target_frame,
            height=len(beams) if organized else 1,
            organized=organized,
        )
        keep = np.concatenate([beam.keep for beam in beams])
        return cloud if keep.all() else cloud.select(keep)


def _picked(points: np.ndarray, keep: np.ndarray, parameters: SonarToCloudParameters) -> Tuple[np.ndarray, np.ndarray]:
    bins, found = picked_bins(points[np.newaxis, :, 3], keep[np.newaxis], parameters)
    return points[bins], found
