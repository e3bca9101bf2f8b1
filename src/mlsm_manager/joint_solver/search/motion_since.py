"""How far a vehicle may have gone since the last scan that told its place."""

from typing import List

import numpy as np

from mlsm_manager.joint_solver.measured.run_log import RunLog
from mlsm_manager.joint_solver.motion.odometry_model import OdometryModel
from mlsm_manager.joint_solver.motion.transition import Transition
from mlsm_manager.joint_solver.unknowns.state import POSE, State

_MOTIONS = np.linspace(-2.0, 2.0, 5)  # standard deviations of the motion within the newest scan, in each direction
_ROUNDING = 1e-6  # m^2, keeps a motion that is known from having no variance


class MotionSince:
    """What is known of the nodes since the last scan that told a place, seen from there.

    Beginning and end of the newest scan matter most: with both given, what is expected of all other nodes follows.
    of_end: (2, 2) m^2, covariance of the end's place. reach: m, the largest deviation of that.
    """

    def __init__(self, log: RunLog, odometry: OdometryModel, state: State, covariance: np.ndarray, silent: int) -> None:
        """`silent`: number of scans between, above 0. covariance: (width, width) of the node before these."""
        last, self._width = log.scan_count, odometry.width
        first = last - 1 - silent
        steps = [
            Transition.of(odometry, state.nodes[node : node + 2], log.node_motion(np.array([node, node + 1])))
            for node in range(first, last)
        ]
        joint = _joint_covariance(steps, covariance)
        self._count = len(steps)
        end = self._width * (self._count - 1) + np.arange(2)
        start = end - self._width
        ends = np.append(start, end)
        self._of_ends = joint[np.ix_(ends, ends)]
        self._gain = joint[:, ends] @ np.linalg.inv(self._of_ends)
        self.of_end = joint[np.ix_(end, end)]
        self.reach = float(np.sqrt(np.linalg.eigvalsh(self.of_end)[-1]))
        self._along = joint[np.ix_(start, end)] @ np.linalg.inv(self.of_end)
        self._beside = joint[np.ix_(start, start)] - self._along @ joint[np.ix_(end, start)]

    def __len__(self) -> int:
        return self._count

    def ends(self, shifts: np.ndarray) -> np.ndarray:
        """Return the moves (k, 4) of beginning and end of the scan that are expected if its end moves by (k, 2)."""
        return np.column_stack([shifts @ self._along.T, shifts])

    def freedom(self) -> np.ndarray:
        """Return moves (k, 2) of the scan's beginning beside the expected ones, that are to be tried."""
        factor = np.linalg.cholesky(self._beside + _ROUNDING * np.eye(2))
        motions = grid(_MOTIONS)
        return motions[np.hypot(*motions.T) <= _MOTIONS.max()] @ factor.T

    def cost(self, ends: np.ndarray) -> float:
        """Return how unlikely moves (4,) of the scan's beginning and end are, nats."""
        return 0.5 * float(ends @ np.linalg.solve(self._of_ends, ends))

    def moves(self, ends: np.ndarray) -> np.ndarray:
        """Return the moves (n, width) of the nodes that go with moves (4,) of the scan's beginning and end."""
        return (self._gain @ ends).reshape(self._count, self._width)


def _joint_covariance(steps: List[Transition], covariance: np.ndarray) -> np.ndarray:
    """Return that of the nodes (n width, n width) after n `steps` from a node whose pose is taken as known."""
    width = len(covariance)
    joint = np.zeros((len(steps) * width,) * 2)
    own = covariance.copy()
    own[POSE] = own[:, POSE] = 0.0
    for number, step in enumerate(steps):
        before, here = slice(0, number * width), slice(number * width, (number + 1) * width)
        if number:
            joint[here, before] = step.matrix @ joint[(number - 1) * width : number * width, before]
            joint[before, here] = joint[here, before].T
        own = step.matrix @ own @ step.matrix.T + step.noise
        joint[here, here] = own
    return joint


def grid(line: np.ndarray) -> np.ndarray:
    """Return the points (n, 2) of a square grid."""
    return np.stack(np.meshgrid(line, line, indexing="ij"), axis=-1).reshape(-1, 2)
