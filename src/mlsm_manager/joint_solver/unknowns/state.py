"""Names of the unknowns and where they stand in a vector.

A node is a moment between two scans. Its first three columns correct the odometry there: T_map_base is the odometry's
pose plus x, y and yaw. An odometry model may add columns of its own. The run's unknowns come after all nodes.
"""

from dataclasses import dataclass, field

import numpy as np

X, Y, YAW = range(3)
POSE = slice(0, 3)
POSE_COLUMNS = 3
RANGE_SCALE, DELAY = range(2)
RUN_COLUMNS = 2
BEFORE_THE_RUN = -2
"""Stands for the scan of points that were in the map before the run; its nodes, -2 and -1, do not exist."""


@dataclass
class State:
    """nodes: (n, width) corrections of the odometry at the nodes. run: (2,) range scale and sonar delay [s]."""

    nodes: np.ndarray
    run: np.ndarray

    def copy(self) -> "State":
        """Return a copy that can be changed alone."""
        return State(self.nodes.copy(), self.run.copy())


@dataclass(frozen=True)
class Layout:
    """Where the free unknowns stand: those of nodes `first` to `last` (both included), then those of the run.

    Nodes before `first` are frozen. Several of them share one group, whose pose stands after the free unknowns.
    group_of_node: (first,) which one; -1 for a node that nothing depends on.
    """

    first: int
    last: int
    width: int
    group_of_node: np.ndarray = field(default_factory=lambda: np.empty(0, dtype=np.int64))

    @property
    def size(self) -> int:
        """Number of free unknowns."""
        return self.run_start + RUN_COLUMNS

    @property
    def run_start(self) -> int:
        """Place of the run's first unknown."""
        return self.width * (self.last - self.first + 1)

    def node_start(self, node: np.ndarray) -> np.ndarray:
        """Return the place of the first column of each node."""
        return self.width * (np.asarray(node) - self.first)

    def pose_columns(self, nodes: np.ndarray) -> np.ndarray:
        """Return the columns (..., 3) of poses of nodes (...); -1 for a frozen one without group or before the run."""
        starts = self.node_start(nodes)
        if self.first:
            groups = self.group_of_node[np.clip(nodes, 0, self.first - 1)]
            frozen = np.where(groups >= 0, self.size + POSE_COLUMNS * groups, -POSE_COLUMNS)
            starts = np.where(nodes >= self.first, starts, frozen)
        starts = np.where(np.asarray(nodes) >= 0, starts, -POSE_COLUMNS)
        return np.maximum(starts[..., np.newaxis] + np.arange(POSE_COLUMNS), -1)
