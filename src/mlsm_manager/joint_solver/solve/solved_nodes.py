"""What the live solver has found of all nodes, and of the unknowns of the whole run."""

from typing import Dict, Mapping

import numpy as np

from mlsm_manager.joint_solver.measured.growing import GrowingArray
from mlsm_manager.joint_solver.unknowns.state import POSE_COLUMNS, State


class SolvedNodes:
    """Unknowns that every scan changes or adds to.

    covariances: rows (3, 3) of the poses of those nodes that stay where they were found. misfits: a variance [m^2] of
    the place for each turn of the head.
    """

    def __init__(self, first_node: np.ndarray, run: np.ndarray) -> None:
        """first_node: (width,) unknowns of the node before the first scan. run: (r,) unknowns of the run."""
        self._nodes = GrowingArray(len(first_node))
        self._nodes.extend(first_node[np.newaxis])
        self._run = run.copy()
        self.covariances = GrowingArray(POSE_COLUMNS, POSE_COLUMNS)
        self.misfits = GrowingArray()

    def __len__(self) -> int:
        """Number of nodes."""
        return len(self._nodes)

    @property
    def state(self) -> State:
        """The unknowns as they are known now, which may be changed in place; valid until nodes are added."""
        return State(self._nodes.values, self._run)

    def extend(self, nodes: np.ndarray) -> None:
        """Append nodes (m, width)."""
        self._nodes.extend(nodes)

    def replace_newest(self, nodes: np.ndarray) -> None:
        """Put nodes (m, width) in place of the m newest ones."""
        self._nodes.replace_from(len(self) - len(nodes), nodes)

    def take_back(self, state: State) -> None:
        """Have nodes and run as they were in `state`, a copy."""
        self._nodes.replace_from(0, state.nodes)
        self._run[:] = state.run

    def stored(self) -> Dict[str, np.ndarray]:
        """Return copies of all that `restore` needs, by name."""
        return {
            "nodes": self._nodes.values.copy(),
            "node_covariances": self.covariances.values.copy(),
            "run_unknowns": self._run.copy(),
            "misfits": self.misfits.values.copy(),
        }

    def restore(self, stored: Mapping[str, np.ndarray], scans: int) -> None:
        """Take what was `stored` after `scans`; raises ValueError for arrays of other shapes, KeyError for none."""
        nodes, covariances = stored["nodes"], stored["node_covariances"]
        width = self._nodes.values.shape[1]
        if nodes.shape != (scans + 1, width) or covariances.shape[1:] != (POSE_COLUMNS, POSE_COLUMNS):
            raise ValueError(f"nodes {nodes.shape}, covariances {covariances.shape} for {scans} scans")
        self.take_back(State(nodes, stored["run_unknowns"]))
        self.covariances.replace_from(0, covariances)
        self.misfits.replace_from(0, stored["misfits"])
