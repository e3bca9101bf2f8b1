"""Collects placed beams into scans (thesis 6.5.2) and whole turns of the head; whether the vehicle moved meanwhile."""

import math
from collections import deque
from dataclasses import dataclass
from itertools import groupby
from typing import Deque, Iterator, List, Optional, Sequence

import numpy as np

from node_support.errors import RefusedInput
from sonar_processing.beams.beam import Beam, PlacedBeam, has_other_bins, long_after, project_beams, servo_moved
from sonar_processing.beams.head import HeadTurn
from sonar_processing.cloud import Cloud
from sonar_processing.scans.parameters import SonarToCloudParameters
from sonar_processing.scans.polar_scan import picked_bins

MOST_BEAMS = 3600  # Beams of 0.1 deg, finer than any head steps; a head that stands still must not fill the memory


@dataclass(frozen=True)
class _Projected:
    """Beams as points: points (n, m, 4), keep (n, m), stamps (n,)."""

    points: np.ndarray
    keep: np.ndarray
    stamps: np.ndarray


class ScanAssembler:
    """Turns placed beams into clouds; holds the beams of the unfinished scan and nothing else."""

    def __init__(self, parameters: SonarToCloudParameters) -> None:
        self.parameters = parameters
        self._beams: List[PlacedBeam] = []
        self._newest: Deque[_Projected] = deque(maxlen=parameters.scan_size)
        self._turn = HeadTurn()
        self.clear()

    def clear(self) -> None:
        """Forget the unfinished scan, because time jumped or the vehicle was carried away."""
        self._beams.clear()
        self._newest.clear()
        self._turn.clear()
        self._last: Optional[Beam] = None

    def project(self, placed: PlacedBeam) -> Cloud:
        return self._cloud([self._projected([placed])], placed.beam)

    def add(self, placed: PlacedBeam) -> Optional[Cloud]:
        """Add a beam; return the scan that it completes, or None.

        A scan ends after `scan_size` beams or when the next beam is expected where the scan began. It also ends when
        the servo moved or when the last beams of a turn were lost: then the new beam belongs to the next scan. In the
        continuous modes every beam returns the newest `scan_size` beams, once there are as many. An unfinished scan
        before a long silence of the head is forgotten: it would come long after its time.
        """
        beam, finished = placed.beam, None
        if self._last is not None and long_after(beam, self._last):
            self.clear()
        elif self._last is not None and (
            servo_moved(beam, self._last) or (self._ends_at_turn and self._turn.would_pass_start(beam.angle))
        ):
            finished = self._finish()
        self._last = beam
        self._turn.add(beam.angle)
        if self.parameters.mode.is_continuous:
            self._newest.append(self._projected([placed]))
            full = len(self._newest) == self.parameters.scan_size
            return self._cloud(list(self._newest), beam) if full else None
        self._beams.append(placed)
        is_complete = len(self._beams) >= self.parameters.scan_size or (self._ends_at_turn and self._turn.is_full)
        return self._finish() if finished is None and is_complete else finished

    @property
    def _ends_at_turn(self) -> bool:
        return self.parameters.end_at_full_turn and not self.parameters.mode.is_continuous

    def _finish(self) -> Optional[Cloud]:
        beams = list(self._beams)
        self.clear()
        if not beams:
            return None
        # All at once, for a beam alone takes five times as long; a head seldom changes its range within a scan.
        alike = groupby(beams, lambda placed: (placed.beam.intensities.size, placed.beam.range_resolution))
        return self._cloud([self._projected(list(group)) for _, group in alike], beams[-1].beam)

    def _projected(self, placed: List[PlacedBeam]) -> _Projected:
        parameters, ranges = self.parameters, placed[0].beam.ranges
        sides = 1 if parameters.mode.is_laser else parameters.dispersed_points
        poses = np.stack([one.T_target_sonar for one in placed])
        points = project_beams([one.beam for one in placed], poses, sides, parameters.beam_width)
        keep = (np.tile(ranges, sides) >= parameters.min_range) & (points[..., 2] <= parameters.height_limit)
        if parameters.mode.is_laser:
            bins, found = picked_bins(points[..., 3], keep, parameters)
            points, keep = points[np.arange(len(placed)), bins][:, np.newaxis], found[:, np.newaxis]
        return _Projected(points, keep, np.array([one.signed_stamp for one in placed]))

    def _cloud(self, parts: List[_Projected], newest: Beam) -> Cloud:
        widths = [part.points.shape[1] for part in parts]
        organized = self.parameters.keep_organized and min(widths) == max(widths)
        cloud = Cloud(
            points=np.concatenate([part.points.reshape(-1, 4) for part in parts]),
            time_stamps=np.concatenate([np.repeat(part.stamps, width) for part, width in zip(parts, widths)]),
            stamp_ns=newest.stamp_ns,
            frame_id=self.parameters.target_frame,
            height=sum(len(part.stamps) for part in parts) if organized else 1,
            organized=organized,
        )
        keep = np.concatenate([part.keep.ravel() for part in parts])
        return cloud if keep.all() else cloud.select(keep)


class RevolutionCollector:
    """Holds the beams of the unfinished turn, whatever a scan is; at most the newest `MOST_BEAMS`."""

    def __init__(self) -> None:
        self._beams: Deque[PlacedBeam] = deque(maxlen=MOST_BEAMS)
        self._turn = HeadTurn()

    def __len__(self) -> int:
        return len(self._beams)

    def clear(self) -> None:
        self._beams.clear()
        self._turn.clear()

    def add(self, placed: PlacedBeam) -> Optional[List[PlacedBeam]]:
        """Add a beam; return the beams of the turn or sweep that it completes, or None.

        All beams of a turn have the same bins. A turn in which the servo or the range of the sonar changed, or the head
        was silent for long, is forgotten; a sweep ends where the head goes back.
        """
        beam, finished = placed.beam, None
        last = self._beams[-1].beam if self._beams else beam
        is_of_other_turn = has_other_bins(beam, last) or beam.frame_id != last.frame_id
        if is_of_other_turn or servo_moved(beam, last) or long_after(beam, last):
            self.clear()
        elif self._turn.would_pass_start(beam.angle) or self._turn.would_reverse(beam.angle):
            finished = self._finish()
        self._beams.append(placed)
        self._turn.add(beam.angle)
        if finished is None and self._turn.is_full:
            finished = self._finish()
        return finished

    def _finish(self) -> List[PlacedBeam]:
        beams = list(self._beams)
        self.clear()
        return beams


def turns_of(beams: Sequence[PlacedBeam], fewest: int) -> Iterator[List[PlacedBeam]]:
    """Yield the beams of each turn or sweep, and of each part of one that other bins or a silence of the head ended.

    Such a part has at least `fewest` beams. What is left at the end comes last, where it is at least half as long as
    the longest turn.
    """
    collector = RevolutionCollector()
    longest = 0
    for index, placed in enumerate(beams):
        held, turn = len(collector), collector.add(placed)
        if turn is not None:
            longest = max(longest, len(turn))
            yield turn
        elif held >= fewest and len(collector) == 1:
            yield list(beams[index - held : index])
    if len(collector) >= max(longest / 2.0, fewest):
        yield list(beams[len(beams) - len(collector) :])


class MovingState:
    """The newest velocity, and how long ago it came in the time of the beams.

    Velocities have no stamp of their own (Twist), so a beam takes the newest one that came before it. A velocity that
    is not followed by another stays valid: a command may be sent once. was_heard: whether any has come.
    """

    def __init__(self) -> None:
        self._speed = 0.0
        self._turn_rate = 0.0
        self.was_heard = False
        self._since_ns: Optional[int] = None

    def take(self, linear: Sequence[float], angular: Sequence[float]) -> None:
        """Take a velocity, m/s and rad/s. Raises RefusedInput when it is not finite; then the last one stays."""
        speed, turn_rate = math.hypot(*linear), math.hypot(*angular)
        if not (math.isfinite(speed) and math.isfinite(turn_rate)):
            raise RefusedInput("velocities refused", f"{tuple(linear)} m/s, {tuple(angular)} rad/s, must be finite")
        self._speed, self._turn_rate = speed, turn_rate
        self.was_heard, self._since_ns = True, None

    def is_moving(self, parameters: SonarToCloudParameters) -> bool:
        """Whether the vehicle is faster than the dead band; without any velocity it is still."""
        return self._speed > parameters.still_speed or self._turn_rate > parameters.still_turn_rate

    def age(self, stamp_ns: int) -> float:
        """Return the seconds between the first beam after the newest velocity and a beam of `stamp_ns`.

        Counted from anew when time jumps back.
        """
        if self._since_ns is None or stamp_ns < self._since_ns:
            self._since_ns = stamp_ns
        return (stamp_ns - self._since_ns) * 1e-9
