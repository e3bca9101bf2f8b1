"""Named sets of parameters for vehicles that know more or less of their own motion, each value with its reason."""

from typing import Any, Dict, List, NamedTuple, Sequence

import yaml

from mlsm_manager.joint_solver.solver_kernel import SolverKernel
from mlsm_manager.localisation.joint_parameters import EstimatorName
from mlsm_manager.localisation.odometry_choice import OdometryKind


class Setting(NamedTuple):
    """A value of a parameter of mlsm_core, and why it is that."""

    key: str
    value: Any
    reason: str


_COMPASS = (
    Setting("heading_deviation", 0.0175, "1 degree: a compass's data sheet, iron near it included"),
    Setting("turn_rate_deviation", 7e-5, "the drift of its gyro between two fixes of the compass is far below that"),
)
_JOINT = Setting("estimator", EstimatorName.JOINT.value, "the newest scans find their poses together")
_NEIGHBOURS = Setting("block_scans", 1, "where little is known of the motion, the scan before is what tells most")
_NORMALS = Setting("normal_deviation", 0.2, "rad: of a straight wall's normals, as a beam of 2.5 degrees hears it")
_POSTS = Setting("lone_quality", 1.0, "posts and buoys tell the way where walls do not")
_NOT_REPORTED = (
    Setting("scale_deviation", 0.0, "no distances are reported"),
    Setting("direction_deviation", 0.0, "no directions of motion are reported"),
)
_TRAVEL = (
    Setting("start_speed_deviation", 0.3, "m/s: the usual speed of a small vehicle; set 0.02 for a standing start"),
    Setting("travel_walk", 0.005, "m/s per root second: the speed of travel may change by 0.1 m/s in 7 minutes"),
)
_UNREPORTED = (
    *_NOT_REPORTED,
    Setting("speed_deviation", 0.15, "m/s: by as much a small vehicle changes its speed while it works"),
    Setting("rate_time", 40.0, "s: as long such a change lasts, a turn or a manoeuvre"),
    *_TRAVEL,
    Setting("slip_deviation", 0.07, "m/s: vehicles go ahead; they slip in turns and in a slow current"),
    Setting("slip_time", 20.0, "s: a turn"),
    _NEIGHBOURS,
    _NORMALS,
    _POSTS,
)

PROFILES: Dict[OdometryKind, Sequence[Setting]] = {
    OdometryKind.DVL: (
        _JOINT,
        Setting("scale_deviation", 0.01, "a DVL's data sheet, speed of sound included"),
        Setting("direction_deviation", 0.1, "rad: the angle at which it is mounted, set by eye to 6 degrees"),
        Setting("speed_deviation", 0.025, "m/s: noise of its velocities"),
        Setting("rate_time", 12.0, "s: as long that noise lasts"),
        Setting("motion_time", 10000.0, "s: scale and mounting hardly change during a mission"),
        *_COMPASS,
    ),
    OdometryKind.THRUSTERS: (
        _JOINT,
        Setting("scale_deviation", 0.3, "the speed at a thrust is known to a third"),
        Setting("direction_deviation", 0.1, "rad: thrusters push ahead to some degrees"),
        Setting("speed_deviation", 0.02, "m/s: what a command leaves open"),
        Setting("rate_time", 60.0, "s: as long that lasts"),
        Setting("motion_time", 3600.0, "s: the scale changes with the battery and with what hangs on the vehicle"),
        Setting("current_deviation", 0.05, "m/s: a current in sheltered water"),
        Setting("current_walk", 0.002, "m/s per root second: the current may change by 0.05 m/s in ten minutes"),
        _NEIGHBOURS,
        _NORMALS,
        _POSTS,
        *_COMPASS,
    ),
    OdometryKind.HEADING: (_JOINT, *_UNREPORTED, *_COMPASS),
    OdometryKind.HOVERING: (
        _JOINT,
        *_NOT_REPORTED,
        Setting("speed_deviation", 0.5, "m/s: such a vehicle goes ahead and back"),
        Setting("rate_time", 10.0, "s: as long as it keeps a speed"),
        *_TRAVEL,
        Setting("slip_deviation", 0.5, "m/s: it strafes as fast as it goes ahead"),
        Setting("slip_time", 10.0, "s: as long as it keeps a speed"),
        Setting("scan_parts", 3, "a turn of the head lasts longer than it takes such a vehicle to change its speed"),
        _NEIGHBOURS,
        Setting("normal_deviation", 0.1, "rad: half of heading's, so that the little that parts of a turn hear counts"),
        _POSTS,
        Setting(
            "solver_kernel", SolverKernel.AUTO.value, "thousands of ways are compared, which compiled loops do faster"
        ),
        *_COMPASS,
    ),
    OdometryKind.NONE: (
        _JOINT,
        *_UNREPORTED,
        Setting("heading_deviation", 0.0, "no compass"),
        Setting("turn_rate_deviation", 0.05, "rad/s: 3 degrees per second, a small vehicle's usual turn"),
        Setting("turn_rate_time", 10.0, "s: as long such a turn lasts"),
    ),
}

_ESTIMATING = (OdometryKind.HEADING, OdometryKind.HOVERING)
"""Profiles whose velocities are estimated and taken by dead_reckoning."""


def profile_values(kind: OdometryKind) -> Dict[str, Any]:
    """Return the parameters of mlsm_core that a profile sets."""
    return {"odometry": kind.value, **{setting.key: setting.value for setting in PROFILES[kind]}}


def profile_yaml(kind: OdometryKind) -> str:
    """Return the text of a profile's yaml file, for the launch files' argument `odometry`.

    Where the odometry is made from the solver's velocities, it also says how dead_reckoning lets them fade.
    """
    lines = [
        f"# Written by scripts/document. The launch files load it with odometry:={kind.value.lower()}.",
        "mlsm_core:",
    ]
    lines.append(f"  odometry: {kind.value}")
    for setting in PROFILES[kind]:
        lines += _lines_of(setting)
    if kind in _ESTIMATING:
        fading = Setting("velocity_fading", profile_values(kind)["rate_time"], "s: rate_time above")
        lines += ["dead_reckoning:", *_lines_of(fading)]
    return "\n".join(lines) + "\n"


def _lines_of(setting: Setting) -> List[str]:
    return [f"  # {setting.reason}", f"  {setting.key}: {yaml.safe_dump(setting.value).splitlines()[0]}"]
