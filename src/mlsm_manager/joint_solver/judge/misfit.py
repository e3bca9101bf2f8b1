"""What a solver cannot know of its own errors: how far a vehicle may have gone while its scans fitted nowhere."""

import numpy as np

from mlsm_manager.joint_solver.judge.continuity import shares_heard_before
from mlsm_manager.joint_solver.measured.run_log import RunLog
from mlsm_manager.joint_solver.motion.motion_models import OdometryModel
from mlsm_manager.joint_solver.parameters import SolverParameters
from mlsm_manager.joint_solver.unknowns.state import State

_FITS = 0.65  # share of a turn's points on what was heard before from which on it fits; see self_check.continuity
_SPEED = 0.5  # m/s: the usual speed of a small vehicle; nothing else tells how far it went


def misfit_variances(
    log: RunLog, odometry: OdometryModel, state: State, parameters: SolverParameters, first: int
) -> np.ndarray:
    """Return by how much (n,) [m^2] each of the turns `first` and newer makes the place of all that follows uncertain.

    In each direction. It is 0 for a turn that fits to those before it, and grows with the share of its points that
    should lie on what these heard and do not, up to as far as a vehicle goes in a turn. Where the odometry reports
    distances it is 0: a motion that is reported is not lost with a scan.
    """
    parts = parameters.parts_per_turn
    times = log.node_times[parts * first :: parts]
    if not np.isinf(odometry.distance_deviation):
        return np.zeros(len(times) - 1)
    shares = shares_heard_before(log, odometry, state, parameters, first)
    misfit = np.clip(1.0 - np.where(np.isfinite(shares), shares, _FITS) / _FITS, 0.0, 1.0)
    return misfit * (_SPEED * np.diff(times)) ** 2
