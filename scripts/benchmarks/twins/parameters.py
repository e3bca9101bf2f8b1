"""What makes one twin differ from another."""

from dataclasses import dataclass
from enum import Enum


class PathForm(Enum):
    """What is made of the recorded path."""

    AS_RECORDED = "AS_RECORDED"
    MIRRORED = "MIRRORED"
    REVERSED = "REVERSED"
    END_FIRST = "END_FIRST"
    THERE_AND_BACK = "THERE_AND_BACK"


@dataclass(frozen=True)
class TwinParameters:
    """Conditions of a twin. Angles in rad, lengths in m, times in s.

    direction, scale: errors of the odometry. range_scale: true range over reported range, minus 1. delay: beams are
    taken this much after their stamps. heading_deviation: of the compass, lasting 300 s. heading_walk: rad/sqrt(s),
    by which the compass drifts besides. speed_deviation: m/s, lasting 12 s. strength: level [dB] of an echo at 10 m.
    half_width: of the beam at half power. echo_length: of a plateau, m per 10 dB above the threshold. objects: piers,
    boats and posts. clutter: share of beams with a false echo. basin_radius, canal_radius: m of water kept free.
    rotation: of the path. binary: strengths are 0 or 127, else graded. soft_iron: of the compass, amplitude of an error
    that turns twice with the heading. ebb: m by which all banks and objects grow into the water during the run, as
    where sloping banks fall dry. ships: that pass within hearing, one after the other, at 1 m/s.
    """

    seed: int = 1
    path: PathForm = PathForm.AS_RECORDED
    rotation: float = 0.0
    direction: float = 0.07
    scale: float = 0.005
    range_scale: float = -0.01
    delay: float = 0.6
    heading_deviation: float = 0.01745
    heading_walk: float = 0.0
    speed_deviation: float = 0.025
    strength: float = 26.0
    half_width: float = 0.0227
    echo_length: float = 1.2
    objects: int = 60
    clutter: float = 0.06
    basin_radius: float = 20.0
    canal_radius: float = 11.0
    binary: bool = True
    soft_iron: float = 0.0
    ebb: float = 0.0
    ships: int = 0


TWINS = {
    "mirrored": TwinParameters(11, PathForm.MIRRORED, 0.7, direction=0.1745, scale=-0.012, delay=0.9),
    "reversed": TwinParameters(12, PathForm.REVERSED, 2.1, direction=-0.14, range_scale=0.03, delay=-0.3),
    "end_first": TwinParameters(13, PathForm.END_FIRST, -1.3, direction=0.05, scale=0.015, range_scale=-0.02),
    "there_and_back": TwinParameters(14, PathForm.THERE_AND_BACK, 0.4, direction=-0.10, scale=0.01, delay=0.2),
    "poor_compass": TwinParameters(15, rotation=1.0, heading_deviation=0.035, heading_walk=0.001, direction=0.03),
    "weak": TwinParameters(16, rotation=2.5, strength=20.0, objects=25, clutter=0.12, direction=-0.06, echo_length=2.0),
    "wide_beam": TwinParameters(17, rotation=-0.5, half_width=0.04, basin_radius=26.0, canal_radius=15.0, delay=1.0),
    "soft_iron": TwinParameters(19, rotation=0.3, soft_iron=0.07, direction=-0.05),
    "short_odometry": TwinParameters(20, rotation=1.7, scale=0.05, direction=0.09),
    "late": TwinParameters(21, rotation=-2.2, delay=1.5, direction=0.04),
    "warm": TwinParameters(22, rotation=2.9, range_scale=0.03, scale=-0.01, direction=-0.08),
    "ebb": TwinParameters(23, rotation=0.9, ebb=2.0, direction=0.06),
    "ships": TwinParameters(24, rotation=-0.9, ships=12, direction=-0.03),
    "open": TwinParameters(25, rotation=1.3, basin_radius=70.0, canal_radius=70.0, objects=8, direction=0.06),
    "graded": TwinParameters(18, PathForm.MIRRORED, 3.0, binary=False, direction=0.08, range_scale=0.015, scale=-0.01),
}
