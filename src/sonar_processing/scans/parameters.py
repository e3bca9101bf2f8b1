"""Parameters of sonar_to_cloud (thesis 6.5.2)."""

import math
from dataclasses import dataclass
from enum import Enum

from node_support import topics
from node_support.headers import StampParameters
from node_support.parameters import ParameterSet, parameter
from sonar_processing.beams.parameters import BeamCorrection, SonarPoseParameters, beam_width_parameter
from sonar_processing.beams.reader import BeamMessageParameters


class ScanMode(Enum):
    """What becomes of a beam, and when a cloud is published."""

    SONAR = "SONAR"
    LASER = "LASER"
    SONAR_CONTINUOUS = "SONARCONT"
    LASER_CONTINUOUS = "LASERCONT"

    @property
    def is_laser(self) -> bool:
        """One point per beam instead of all bins."""
        return self in (ScanMode.LASER, ScanMode.LASER_CONTINUOUS)

    @property
    def is_continuous(self) -> bool:
        """A cloud of the newest beams after every beam, instead of one per scan."""
        return self in (ScanMode.SONAR_CONTINUOUS, ScanMode.LASER_CONTINUOUS)


class LaserPick(Enum):
    STRONGEST = "STRONGEST"
    FIRST = "FIRST"


class VelocityType(Enum):
    TWIST = "TWIST"
    TWIST_STAMPED = "TWIST_STAMPED"
    ODOMETRY = "ODOMETRY"


@dataclass(frozen=True)
class ScanParameters(ParameterSet):
    """How beams become points, points become scans, and when the vehicle counts as still."""

    mode: ScanMode = parameter(
        ScanMode.SONAR,
        "SONAR: all bins of a beam, LASER: one bin; with CONT: from scan_size on a cloud after every beam",
        thesis_name="mode",
    )
    scan_size: int = parameter(120, "beams that make a scan", low=1, high=3600, thesis_name="scanSize")
    end_at_full_turn: bool = parameter(True, "end a scan before the head passes its start again")
    target_frame: str = parameter("odom", "frame the clouds are placed in", tunable=False, thesis_name="targetFrame")
    min_range: float = parameter(0.5, "nearer bins are removed: there the head rings", unit="m", low=0.0, high=100.0)
    height_limit: float = parameter(
        100.0, "points higher than this in the target frame are removed", unit="m", low=-12000.0, high=12000.0,
        thesis_name="heightLimit",
    )  # fmt: skip
    keep_organized: bool = parameter(
        False, "one row per beam, with NaN in place of removed points", thesis_name="keepOrganized"
    )
    dispersed_points: int = parameter(
        1, "points per bin, spread across the width of the beam", low=1, high=15, thesis_name="dispersedPoints"
    )
    beam_width: float = beam_width_parameter()
    laser_pick: LaserPick = parameter(
        LaserPick.STRONGEST, "the bin that LASER and the laser scan take: the strongest, or the first strong enough"
    )
    laser_strongest_above: float = parameter(
        0.0, "STRONGEST: a beam whose strongest bin is not above this has no point",
        unit="echo strength", low=0.0, high=255.0,
    )  # fmt: skip
    laser_first_above: float = parameter(
        50.0, "FIRST: the nearest bin above this is taken", unit="echo strength", low=0.0, high=255.0
    )
    laser_scan_rays: int = parameter(0, "rays of the laser scan; 0: one for each step of the head", low=0, high=7200)
    velocity_topic: str = parameter(
        topics.VELOCITY_COMMANDS,
        "topic with the velocity of the vehicle",
        tunable=False,
        thesis_name="velSubscribeTopic",
    )
    velocity_type: VelocityType = parameter(VelocityType.TWIST, "type of the velocity topic", tunable=False)
    velocity_timeout: float = parameter(
        2.0, "warn when a moving vehicle sends no velocity for longer", unit="s", low=0.0, high=3600.0
    )
    still_speed: float = parameter(0.01, "slower than this counts as still", unit="m/s", low=0.0, high=1.0)
    still_turn_rate: float = parameter(0.005, "slower turning counts as still", unit="rad/s", low=0.0, high=1.0)


@dataclass(frozen=True)
class SonarToCloudParameters(
    SonarPoseParameters, BeamMessageParameters, BeamCorrection, ScanParameters, StampParameters
):
    sonar_turned: float = parameter(
        0.0, "how far the sonar is turned against tf, counter-clockwise seen from above, as mlsm_core names it",
        unit="rad", low=-2.0 * math.pi, high=2.0 * math.pi,
    )  # fmt: skip
