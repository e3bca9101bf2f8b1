"""Collects placed beams into scans (thesis 6.5.2)."""

import math
from collections import deque
from dataclasses import dataclass
from enum import Enum
from typing import Deque, List, Optional

import numpy as np

from node_support.parameters import ParameterSet, parameter
from sonar_processing.beam import Beam
from sonar_processing.cloud import IntensityCloud
from sonar_processing.projection import project_beam, wrapped

SERVO_DEAD_BAND = 1e-3


class ScanMode(Enum):
    """What becomes of a beam, and when a cloud is published."""

    SONAR = "SONAR"
    LASER = "LASER"
    SONAR_CONTINUOUS = "SONARCONT"
    LASER_CONTINUOUS = "LASERCONT"

    @property
    def is_laser(self) -> bool:
        """One point per beam, the strongest, instead of all bins."""
        return self in (ScanMode.LASER, ScanMode.LASER_CONTINUOUS)

    @property
    def is_continuous(self) -> bool:
        """A cloud of the newest beams after every beam, instead of one per scan."""
        return self in (ScanMode.SONAR_CONTINUOUS, ScanMode.LASER_CONTINUOUS)


@dataclass(frozen=True)
class SonarToCloudParameters(ParameterSet):
    """Parameters of sonar_to_cloud."""

    mode: ScanMode = parameter(
        ScanMode.SONAR, "all bins or the strongest one; CONT: a cloud per beam", thesis_name="mode"
    )
    scan_size: int = parameter(120, "beams that make a scan", low=1, high=3600, thesis_name="scanSize")
    end_at_full_turn: bool = parameter(True, "end a scan when the head passes its start again")
    target_frame: str = parameter("odom", "frame the clouds are placed in", tunable=False, thesis_name="targetFrame")
    min_range: float = parameter(0.5, "bins nearer than this are ringing of the head", unit="m", low=0.0, high=100.0)
    height_limit: float = parameter(
        100.0, "points higher than this in the target frame are removed", unit="m", low=-12000.0, high=12000.0
    )
    keep_organized: bool = parameter(False, "rows are beams; removed points become NaN instead of going")
    dispersed_points: int = parameter(1, "points per bin, spread across the beam's width", low=1, high=15)
    beam_width: float = parameter(0.0436, "horizontal width of the beam", unit="rad", low=0.0, high=0.5)
    still_speed: float = parameter(0.01, "slower than this counts as still", unit="m/s", low=0.0, high=1.0)
    still_turn_rate: float = parameter(
        0.005, "turning slower than this counts as still", unit="rad/s", low=0.0, high=1.0
    )


@dataclass(frozen=True)
class PlacedBeam:
    """A beam, its pose when the ping left (T_target_sonar, (4, 4)) and whether the vehicle moved."""

    beam: Beam
    T_target_sonar: np.ndarray
    is_moving: bool


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
        self.clear()

    def clear(self) -> None:
        """Forget the unfinished scan, because time jumped or the vehicle was carried away."""
        self._beams.clear()
        self._last: Optional[Beam] = None
        self._swept = 0.0
        self._smallest_step = math.inf

    def project(self, placed: PlacedBeam) -> IntensityCloud:
        """Return one beam as a cloud, as it is shown while the scan grows."""
        return self._cloud([self._projected(placed)], placed.beam)

    def add(self, placed: PlacedBeam) -> Optional[IntensityCloud]:
        """Add a beam; return the scan that it completes, or None.

        A scan ends after `scan_size` beams, when the head is about to pass its start again, or when the servo moved:
        then the new beam belongs to the next scan. In the continuous modes every beam returns the newest
        `scan_size` beams.
        """
        beam = placed.beam
        finished = self._finish() if self._servo_moved(beam) else None
        self._turn_to(beam)
        self._beams.append(self._projected(placed))
        if self.parameters.mode.is_continuous:
            return self._cloud(list(self._beams), beam)
        if finished is None and self._is_complete():
            finished = self._finish()
        return finished

    def _servo_moved(self, beam: Beam) -> bool:
        return self._last is not None and abs(beam.sensor_angle - self._last.sensor_angle) > SERVO_DEAD_BAND

    def _turn_to(self, beam: Beam) -> None:
        step = 0.0 if self._last is None else wrapped(beam.angle - self._last.angle)
        if step != 0.0:
            self._smallest_step = min(self._smallest_step, abs(step))
        self._swept += step
        self._last = beam

    def _is_complete(self) -> bool:
        if len(self._beams) >= self.parameters.scan_size:
            return True
        if not self.parameters.end_at_full_turn or not math.isfinite(self._smallest_step):
            return False
        return abs(self._swept) + 1.5 * self._smallest_step >= 2.0 * math.pi

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
        keep = np.tile(beam.ranges >= parameters.min_range, sides)
        keep &= points[:, 2] <= parameters.height_limit
        seconds = beam.stamp_ns * 1e-9
        signed_stamp = seconds if placed.is_moving else -seconds
        if parameters.mode.is_laser:
            points, keep = _strongest(points, keep)
        return _ProjectedBeam(points, keep, signed_stamp)

    def _cloud(self, beams: List[_ProjectedBeam], newest: Beam) -> IntensityCloud:
        widths = [len(beam.points) for beam in beams]
        organized = self.parameters.keep_organized and min(widths) == max(widths)
        cloud = IntensityCloud(
            points=np.concatenate([beam.points for beam in beams]),
            time_stamps=np.repeat([beam.signed_stamp for beam in beams], widths),
            stamp_ns=newest.stamp_ns,
            frame_id=self.parameters.target_frame,
            height=len(beams) if organized else 1,
        )
        keep = np.concatenate([beam.keep for beam in beams])
        return cloud if keep.all() else cloud.select(keep)


def _strongest(points: np.ndarray, keep: np.ndarray) -> tuple:
    strengths = np.where(keep, points[:, 3], -1.0)
    index = int(np.argmax(strengths))
    return points[index : index + 1], np.array([strengths[index] > 0.0])
