"""Names of the unknowns, where they stand in a vector, and sums of weighted residuals as normal equations for them.

A node is a moment between two scans. Its first three columns correct the odometry there: T_map_base is the odometry's
pose plus x, y and yaw. An odometry model may add columns of its own. The run's unknowns come after all nodes.
"""

from dataclasses import dataclass, field
from functools import cached_property, partial
from typing import Callable, Iterator, NamedTuple, Sequence, Tuple

import numpy as np
import scipy.linalg
import scipy.sparse
import scipy.sparse.linalg

from mlsm_manager.joint_solver.compiled_comparisons import scattered_terms

X, Y, YAW = range(3)
POSE = slice(0, 3)
POSE_COLUMNS = 3
RANGE_SCALE, DELAY = range(2)
RUN_COLUMNS = 2
BEFORE_THE_RUN = -2  # stands for the scan of points from before the run; its nodes, -2 and -1, do not exist
HELD_DEVIATION = 1e-6  # stands for a deviation of zero
_REGULARISATION = 1e-9  # of a column that no residual touches: it stays where it is
_MOST_DENSE = 5000  # unknowns, about 1000 scans or parts of scans: up to there dense takes 200 MB and is faster


@dataclass
class State:
    """nodes: (n, width) corrections of the odometry at the nodes. run: (2,) range scale and sonar delay [s]."""

    nodes: np.ndarray
    run: np.ndarray

    def copy(self) -> "State":
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

    @cached_property
    def run_start(self) -> int:
        """Place of the run's first unknown."""
        return self.width * (self.last - self.first + 1)

    @cached_property
    def size(self) -> int:
        """Number of free unknowns."""
        return self.run_start + RUN_COLUMNS

    def node_start(self, node: np.ndarray) -> np.ndarray:
        """Return the place of the first column of each node."""
        return self.width * (np.asarray(node) - self.first)

    def with_run(self, nodes: np.ndarray) -> np.ndarray:
        """Return the columns (n, width + 2) of all unknowns of free `nodes` (n,), each followed by those of the run."""
        own = self.node_start(nodes)[:, np.newaxis] + np.arange(self.width)
        return np.column_stack([own, np.tile(self.run_start + np.arange(RUN_COLUMNS), (len(own), 1))])

    def pose_columns(self, nodes: np.ndarray) -> np.ndarray:
        """Return the columns (..., 3) of poses of nodes (...); -1 for a frozen one without group or before the run."""
        starts = self.node_start(nodes)
        if self.first:
            groups = self.group_of_node[np.clip(nodes, 0, self.first - 1)]
            frozen = np.where(groups >= 0, self.size + POSE_COLUMNS * groups, -POSE_COLUMNS)
            starts = np.where(nodes >= self.first, starts, frozen)
        starts = np.where(np.asarray(nodes) >= 0, starts, -POSE_COLUMNS)
        return np.maximum(starts[..., np.newaxis] + np.arange(POSE_COLUMNS), -1)


class Residuals(NamedTuple):
    """m residuals of c unknowns each.

    columns: (m, c) int, of each residual's unknowns, negative for constants. jacobian: (m, c). values, weights: (m,); a
    weight is the inverse of the variance.
    """

    columns: np.ndarray
    jacobian: np.ndarray
    values: np.ndarray
    weights: np.ndarray


def prior_of(columns: np.ndarray, off: np.ndarray, deviation: np.ndarray, held: Sequence[int] = ()) -> Residuals:
    """Return that unknowns in `columns` (m,) should not be `off` (m,) from their means but for `deviation` (m,).

    held: columns of held unknowns with which the means of the first ones go.
    """
    pairs = np.full((len(off), 2), -1)
    pairs[:, 0], pairs[: len(held), 1] = columns, held
    return Residuals(pairs, np.tile([1.0, -1.0], (len(off), 1)), off, np.maximum(deviation, HELD_DEVIATION) ** -2.0)


def moves_between(layout: Layout, ends: np.ndarray, errors: np.ndarray, deviation: float) -> Iterator[Residuals]:
    """Yield in x and y by how much moves from the second to the first of two nodes `ends` (m, 2) are off.

    errors: (m, 2) m in map. deviation: m, in each direction.
    """
    columns = layout.pose_columns(ends)
    jacobian, weights = np.tile([1.0, -1.0], (len(ends), 1)), np.full(len(ends), deviation**-2.0)
    for axis in (0, 1):
        yield Residuals(columns[:, :, axis], jacobian, errors[:, axis], weights)


class NormalEquations:
    """information @ step = -gradient of `size` free unknowns; after them come the columns of `held` ones."""

    def __init__(self, size: int, held: int = 0) -> None:
        self.size = size
        self._columns_end = size + held
        self.gradient = np.zeros(size)
        self.cost = 0.0
        self._columns = []
        self._terms = []

    def add(self, *sets: Residuals) -> None:
        for columns, jacobian, values, weights in sets:
            weighted = weights[:, np.newaxis] * jacobian
            self.add_terms(
                columns, weighted[:, :, np.newaxis] * jacobian[:, np.newaxis], weighted * values[:, np.newaxis]
            )
            self.cost += float(np.sum(weights * values**2))

    def add_terms(self, columns: np.ndarray, information: np.ndarray, gradient: np.ndarray) -> None:
        """Add m sums: columns (m, c) as those of Residuals, information (m, c, c), gradient (m, c)."""
        columns = np.where(columns < 0, self._columns_end, columns)
        summed = np.bincount(columns.ravel(), gradient.ravel(), self._columns_end + 1)[: self.size]
        self.gradient = self.gradient + summed
        self._columns.append(columns)
        self._terms.append(information)

    def dense(self) -> Tuple[np.ndarray, np.ndarray]:
        """Return the information of the free unknowns (size, size), and that between them and the held ones.

        For problems of bounded size.
        """
        side = self._columns_end + 1
        result = np.zeros((side, side))
        for columns, terms in zip(self._columns, self._terms):
            scattered_terms(result, np.ascontiguousarray(columns), np.ascontiguousarray(terms))
        result = result[: self.size, : self._columns_end]
        result[np.diag_indices(self.size)] += _REGULARISATION
        return result[:, : self.size], result[:, self.size :].copy()

    def sparse(self) -> scipy.sparse.csc_matrix:
        """Return the information as a sparse matrix (size, size)."""
        side = self._columns_end + 1
        rows = [np.repeat(columns, columns.shape[1], axis=1).ravel() for columns in self._columns]
        across = [np.tile(columns, (1, columns.shape[1])).ravel() for columns in self._columns]
        values = np.concatenate([term.ravel() for term in self._terms])
        places = (np.concatenate(rows), np.concatenate(across))
        whole = scipy.sparse.coo_matrix((values, places), (side, side)).tocsc()
        return (whole[: self.size, : self.size] + _REGULARISATION * scipy.sparse.eye(self.size)).tocsc()


@dataclass(frozen=True)
class EquationSolution:
    """solve: returns the inverse of the information times (size, k). step: (size,) of the free unknowns.

    to_held: (size, h) the information between the free unknowns and the held ones.
    """

    solve: Callable[[np.ndarray], np.ndarray]
    step: np.ndarray
    to_held: np.ndarray

    def covariances(self, columns: np.ndarray, held_covariance: np.ndarray) -> Tuple[np.ndarray, np.ndarray]:
        """Return the covariances (b, k, k) of b sets of unknowns, `columns` (b, k), where held ones err by
        `held_covariance`, and the same if these had no error.

        That is what Schmidt (1966) calls considering the parameters that are not estimated.
        """
        sets, each = columns.shape
        unit = np.zeros((len(self.step), columns.size))
        unit[columns.ravel(), np.arange(columns.size)] = 1.0
        gain = self.solve(unit)
        own = gain.reshape(-1, sets, each)[columns, np.arange(sets)[:, np.newaxis]]
        by_held = (gain.T @ self.to_held).reshape(sets, each, -1)
        return own + by_held @ held_covariance @ by_held.transpose(0, 2, 1), own


def dense_solution(equations: NormalEquations) -> EquationSolution:
    information, to_held = equations.dense()
    solve = partial(scipy.linalg.cho_solve, scipy.linalg.cho_factor(information))
    return EquationSolution(solve, -solve(equations.gradient), to_held)


def sparse_solution(equations: NormalEquations) -> EquationSolution:
    """Return the solution of equations in which nothing is held."""
    solve = scipy.sparse.linalg.splu(equations.sparse()).solve
    return EquationSolution(solve, -solve(equations.gradient), np.zeros((equations.size, 0)))


def solution_of(equations: NormalEquations) -> EquationSolution:
    """Return the solution, found in the way that is faster for its size; of large ones nothing may be held."""
    return dense_solution(equations) if equations.size <= _MOST_DENSE else sparse_solution(equations)
