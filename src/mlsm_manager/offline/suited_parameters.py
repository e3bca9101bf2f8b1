"""What a recording tells of its odometry, and the parameters that suit it."""

from typing import Collection, NamedTuple, Optional

import numpy as np

from mlsm_manager.joint_solver.live_solver import LiveSolver
from mlsm_manager.joint_solver.map_support import shares_heard_before
from mlsm_manager.localisation.odometry_profiles import OdometryKind, profile_values
from mlsm_manager.localisation.reported_motion import ReportedMotion
from mlsm_manager.offline.replay_parameters import ReplayParameters
from mlsm_manager.scan_matching.scan import Track
from mlsm_manager.self_check.map_checks import scans_go_on

_WORTH_TRYING = 0.75
"""Share of scans that go on, below which a second mapping is worth its time. Simulated tours ahead have 0.85 and more,
strafing ones 0.57 and 0.66."""


class OdometryFound(NamedTuple):
    """kind: of the odometry. reason: one line that says why."""

    kind: OdometryKind
    reason: str


def odometry_of(track: Track) -> OdometryFound:
    """Return what a recording's T_odom_base tells of the vehicle's motion."""
    motion = ReportedMotion()
    motion.learn(track)
    if motion.has_positions:
        reason = f"positions change by up to {motion.extent:.1f} m"
    elif motion.has_headings:
        reason = f"the position never changes, the heading by {np.degrees(motion.turned):.0f} degrees"
    else:
        reason = "neither position nor heading changes, so the vehicle stands still; if it moved, say --unknown-motion"
    return OdometryFound(motion.kind, reason)


def with_odometry(parameters: ReplayParameters, kind: OdometryKind, fixed: Collection[str]) -> ReplayParameters:
    """Return `parameters` with the profile of an odometry, but for those that are `fixed`."""
    return parameters.changed({key: value for key, value in profile_values(kind).items() if key not in fixed})


def may_strafe(ahead: Optional[LiveSolver]) -> bool:
    """Return whether scans do not go on in the run of a solver that expects the vehicle to go ahead."""
    if ahead is None:
        return False
    shares = shares_heard_before(ahead.solution, 0)
    return scans_go_on(ahead.log.node_times[1:], shares, _WORTH_TRYING).fires
