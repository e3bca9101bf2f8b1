"""How far a path is from a truth that is known, and how honest it is about that."""

from typing import List, NamedTuple, Tuple

import numpy as np

from mlsm_manager.joint_solver.odometry_log import as_complex
from mlsm_manager.localisation.odometry_profiles import OdometryKind
from mlsm_manager.offline.recording import Recording, scans_of
from mlsm_manager.offline.replay import ReplayParameters
from mlsm_manager.offline.suited_parameters import with_odometry
from mlsm_manager.scan_matching.scan import Scan
from sonar_processing.filters.echo_extractor import EchoExtractor


class PathFigures(NamedTuple):
    """Of a path at the scans' ends; path and truth begin at the same place and are not turned.

    mean, most: distance from the truth [m]. shape: mean distance [m] once the path is shifted, turned and scaled to
    fit best: what is left of `mean` if compass, odometry and speed of sound were right on average. nees: squared error
    over stated variance, per state; 1 is true. stated, stated_most: median and largest stated deviation [m]. within:
    share of the scans within three of them.
    """

    mean: float
    most: float
    shape: float
    nees: float
    stated: float
    stated_most: float
    within: float


def judged(path: np.ndarray, truth: np.ndarray, covariances: np.ndarray) -> PathFigures:
    """Return the figures of a path (n, 2) with its stated covariances (n, 2, 2); truth: (n, 2), aligned."""
    error = path - truth
    squared = np.einsum("na,na->n", error, np.linalg.solve(covariances, error[..., np.newaxis])[..., 0])
    distance, stated = np.hypot(*error.T), np.sqrt(np.trace(covariances, axis1=1, axis2=2))
    own, true = (as_complex(places - places.mean(axis=0)) for places in (path, truth))
    shape = np.abs(true - np.vdot(own, true) / np.vdot(own, own) * own).mean()
    return PathFigures(
        distance.mean(), distance.max(), shape, squared.mean() / 2.0, np.median(stated), stated.max(),
        np.mean(distance < 3.0 * stated),
    )  # fmt: skip


def replay_input(recording: Recording, kind: OdometryKind) -> Tuple[List[Scan], ReplayParameters]:
    """Return the scans and parameters that map_bag uses for an odometry."""
    parameters = with_odometry(ReplayParameters(), kind, ())
    return [scan for scan, _ in scans_of(recording, EchoExtractor(parameters.echoes()))], parameters
