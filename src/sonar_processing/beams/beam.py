"""One beam of a mechanically scanned sonar, where it was sent, and where its bins lie (thesis 6.5.2)."""

import math
from dataclasses import dataclass, replace
from typing import Sequence

import numpy as np

from node_support.errors import RefusedInput
from node_support.geometry import pose_matrix

MAX_BINS = 4096  # Four times what scanning sonars send (Micron 800, Imagenex 852 500); more is a broken message

# m: ten times what scanning sonars hear; farther points would only cost precision.
FARTHEST_RANGE = 10_000.0
_MOST_ANGLE = 1e6  # rad: more turns than any head counts; a broken message has up to 1e308
SERVO_DEAD_BAND = 1e-3  # rad: a servo that holds its place trembles by less, and none steps by as little
_ROUNDING = 1e-4  # Share: of a length of bins that was computed from float32
# Longer than any head takes for some beams, shorter than a slow turn: the vehicle is elsewhere by then.
_LONGEST_NS = 10 * 10**9


@dataclass(frozen=True)
class Beam:
    """Echo strengths along one direction of the head. Raises RefusedInput when they cannot be placed in space.

    stamp_ns: when the ping left, nanoseconds; the only time that is not in seconds, because tf compares it exactly.
    angle: of the head, rad, counter-clockwise about +z of `frame_id` from +x.
    intensities: (bins,) uint8; bin i holds the echoes from i to i + 1 times `range_resolution` metres.
    sensor_angle: tilt of the sonar's servo, rad.
    bin_place: where in its bin an echo is drawn, 0 the near end and 1 the far one.
    """

    stamp_ns: int
    frame_id: str
    angle: float
    intensities: np.ndarray
    range_resolution: float
    sensor_angle: float = 0.0
    bin_place: float = 0.5

    def __post_init__(self) -> None:
        if self.stamp_ns < 0:
            raise RefusedInput("beams refused", f"stamp {self.stamp_ns * 1e-9:.3f} s, below 0; check sonar_delay")
        bins = self.intensities.size
        if not 1 <= bins <= MAX_BINS:
            raise RefusedInput("beams refused", f"{bins} bins, must be 1 to {MAX_BINS}; check the driver")
        if not (math.isfinite(self.range_resolution) and self.range_resolution > 0.0):
            raise RefusedInput(
                "beams refused", f"range_resolution {self.range_resolution}, must be above 0 m; check the driver"
            )
        if bins * self.range_resolution > FARTHEST_RANGE:
            reach = f"{bins} bins of {self.range_resolution:g} m reach {bins * self.range_resolution:g} m"
            raise RefusedInput("beams refused", f"{reach}, must be at most {FARTHEST_RANGE:g} m; check the driver")
        if not all(abs(angle) <= _MOST_ANGLE for angle in (self.angle, self.sensor_angle)):
            angles = f"head at {self.angle} rad, servo at {self.sensor_angle} rad"
            raise RefusedInput("beams refused", f"{angles}, must be at most {_MOST_ANGLE:g} rad; check the driver")
        if not self.frame_id:
            raise RefusedInput("beams refused", "frame_id is empty; set the driver's frame")

    @property
    def ranges(self) -> np.ndarray:
        """(bins,) distance at which the echoes of each bin are drawn, m."""
        return (np.arange(self.intensities.size) + self.bin_place) * self.range_resolution


@dataclass(frozen=True)
class PlacedBeam:
    """A beam, its pose when the ping left (T_target_sonar, (4, 4)) and whether the vehicle moved."""

    beam: Beam
    T_target_sonar: np.ndarray
    is_moving: bool

    def turned(self, angle: float) -> "PlacedBeam":
        """Return the beam of a sonar that is turned by `angle` [rad] more about the target frame's z, where it is."""
        T_turned = self.T_target_sonar.copy()
        T_turned[:3, :3] = pose_matrix((0.0, 0.0, 0.0), (0.0, 0.0, angle))[:3, :3] @ self.T_target_sonar[:3, :3]
        return replace(self, T_target_sonar=T_turned)

    @property
    def signed_stamp(self) -> float:
        """Seconds at which the ping left, negative while the vehicle was still (thesis 4.5.1)."""
        seconds = self.beam.stamp_ns * 1e-9
        return seconds if self.is_moving else -seconds


def servo_moved(beam: Beam, earlier: Beam) -> bool:
    """Whether the servo stands elsewhere than at an earlier beam; it may tremble."""
    return abs(beam.sensor_angle - earlier.sensor_angle) > SERVO_DEAD_BAND


def has_other_bins(beam: Beam, earlier: Beam) -> bool:
    """Whether number or length of a beam's bins are others than an earlier one's, but for rounding."""
    same = math.isclose(beam.range_resolution, earlier.range_resolution, rel_tol=_ROUNDING)
    return beam.intensities.size != earlier.intensities.size or not same


def long_after(beam: Beam, earlier: Beam) -> bool:
    """Return whether the head was silent so long between two beams that they make no scan together."""
    return beam.stamp_ns - earlier.stamp_ns > _LONGEST_NS


def project_beams(
    beams: Sequence[Beam], T_target_sonar: np.ndarray, dispersed_points: int, beam_width: float
) -> np.ndarray:
    """Return (n, dispersed_points * bins, 4) float32: x y z [m] in the target frame and echo strength, of n beams.

    Every bin is drawn as `dispersed_points` points side by side across the horizontal `beam_width` [rad]; one point
    lies on the beam's axis. The points of a beam come ordered by side, then by range. The beams have the same ranges;
    T_target_sonar is (n, 4, 4).
    """
    angles = np.array([beam.angle for beam in beams])
    half_width = beam_width / 2.0 if dispersed_points > 1 else 0.0
    headings = angles[:, np.newaxis] + np.linspace(-half_width, half_width, dispersed_points)
    poses, strengths = (
        np.repeat(values, dispersed_points, axis=0)
        for values in (T_target_sonar, np.stack([beam.intensities for beam in beams]))
    )
    directions = beam_directions(headings.ravel(), poses)
    return bin_points(poses[:, :3, 3], directions, beams[0].ranges, strengths).reshape(len(beams), -1, 4)


def beam_directions(headings: np.ndarray, T_target_sonar: np.ndarray) -> np.ndarray:
    """Return (n, 3) unit vectors in the target frame along `headings` (n,) of the head [rad].

    T_target_sonar is (4, 4), or (n, 4, 4) with one pose for each heading.
    """
    heads = np.column_stack([np.cos(headings), np.sin(headings)])
    return np.einsum("...ij,...j->...i", T_target_sonar[..., :3, :2], heads)


def bin_points(origins: np.ndarray, directions: np.ndarray, ranges: np.ndarray, strengths: np.ndarray) -> np.ndarray:
    """Return (n, bins, 4) float32: x y z [m] of all bins of n beams, and their echo strengths.

    origins: (n, 3) m; directions: (n, 3) unit vectors; ranges: (bins,) m; strengths: (bins,) or (n, bins).
    """
    points = np.empty((len(origins), ranges.size, 4), dtype=np.float32)
    # One axis after the other takes a third of the time of all at once: numpy's inner loops are long then.
    for axis in range(3):
        along = np.multiply.outer(directions[:, axis], ranges)
        along += origins[:, axis, np.newaxis]
        points[..., axis] = along
    points[..., 3] = strengths
    return points
