"""Which odometry a recording holds, told from what it reports."""

from typing import Collection, NamedTuple, Optional

import numpy as np

from mlsm_manager.joint_solver.compare.map_support import shares_heard_before
from mlsm_manager.joint_solver.solve.live_solver import LiveSolver
from mlsm_manager.localisation.odometry_profiles import OdometryKind, profile_values
from mlsm_manager.offline.replay_parameters import ReplayParameters
from mlsm_manager.scan_matching.scan import Track
from mlsm_manager.self_check.map_checks import scans_go_on

_STANDS = 0.05  # m: a position that moves by less never changed, but for rounding and lever arms of a tilting base
_TURNS = 0.02  # rad: a compass at rest says less, a vehicle that travels turns more
_WORTH_TRYING = 0.75
"""Share of scans that go on, below which a second mapping is worth its time. Simulated tours ahead have 0.85 and more,
strafing ones 0.57 and 0.66."""


class OdometryFound(NamedTuple):
    """kind: of the odometry. reason: one line that says why."""

    kind: OdometryKind
    reason: str


def odometry_of(track: Track) -> OdometryFound:
    """Return what a recording's T_odom_base tells of the vehicle's motion."""
    extent = np.ptp(track.poses[:, :2], axis=0).max()
    turned = np.ptp(track.poses[:, 2])
    if extent > _STANDS:
        reason = f"positions change by up to {extent:.1f} m; say --odometry thrusters if no DVL measured them"
        return OdometryFound(OdometryKind.DVL, reason)
    if turned > _TURNS:
        degrees = np.degrees(turned)
        return OdometryFound(OdometryKind.HEADING, f"the position never changes, the heading by {degrees:.0f} degrees")
    reason = "neither position nor heading changes, so the vehicle stands still; if it moved, say --unknown-motion"
    return OdometryFound(OdometryKind.DVL, reason)


def with_odometry(parameters: ReplayParameters, kind: OdometryKind, fixed: Collection[str]) -> ReplayParameters:
    """Return `parameters` with the profile of an odometry, but for those that are `fixed`."""
    return parameters.changed({key: value for key, value in profile_values(kind).items() if key not in fixed})


def may_strafe(ahead: Optional[LiveSolver]) -> bool:
    """Return whether scans do not go on in the run of a solver that expects the vehicle to go ahead."""
    if ahead is None:
        return False
    shares = shares_heard_before(ahead.log, ahead.odometry, ahead.state, ahead.parameters, 0)
    return scans_go_on(ahead.log.node_times[1:], shares, _WORTH_TRYING).fires
