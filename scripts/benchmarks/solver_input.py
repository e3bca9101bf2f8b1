"""Scans and parameters of a recording as map_bag has them."""

from typing import List, Tuple

from mlsm_manager.joint_solver.parameters import MultiViewParameters
from mlsm_manager.localisation.odometry_choice import OdometryKind
from mlsm_manager.offline.echo_length import echo_sigma
from mlsm_manager.offline.echo_shape import EchoShape, suited
from mlsm_manager.offline.odometry_kind import with_odometry
from mlsm_manager.offline.recording import Recording, scans_of
from mlsm_manager.offline.replay_parameters import ReplayParameters
from mlsm_manager.scan_matching.prediction import OdometryErrors
from mlsm_manager.scan_matching.scan import Scan


def solver_input(recording: Recording, kind: OdometryKind, shape: EchoShape) -> Tuple[List[Scan], MultiViewParameters]:
    """Return the scans, and what is known before the run of a sonar whose echoes have a shape."""
    sigma = echo_sigma([placed.beam for placed in recording.beams])
    parameters = suited(with_odometry(ReplayParameters(), kind, ()), shape, (), sigma)
    scans = [scan for scan, _ in scans_of(recording, parameters.echoes())]
    return scans, parameters.solver_parameters(parameters.part(OdometryErrors), parameters.range_scale_deviation)
