"""Sums of weighted residuals as normal equations, gathered in small blocks of columns."""

import numpy as np
import scipy.linalg
import scipy.sparse
import scipy.sparse.linalg

_REGULARISATION = 1e-9  # of a column that no residual touches: it stays where it is


class NormalEquations:
    """information @ step = -gradient. Columns beyond `size` belong to unknowns that are held and are left out."""

    def __init__(self, size: int) -> None:
        self.size = size
        self.gradient = np.zeros(size)
        self.cost = 0.0
        self._columns = []
        self._blocks = []

    def add(self, columns: np.ndarray, jacobian: np.ndarray, residual: np.ndarray, weight: np.ndarray) -> None:
        """Add m residuals of c columns each.

        columns: (m, c) int, of each residual's unknowns, negative where an unknown is held. jacobian: (m, c).
        residual, weight: (m,); the weight is the inverse of the variance.
        """
        weighted = weight[:, np.newaxis] * jacobian
        self.add_blocks(
            columns, weighted[:, :, np.newaxis] * jacobian[:, np.newaxis], weighted * residual[:, np.newaxis]
        )
        self.cost += float(np.sum(weight * residual**2))

    def add_blocks(self, columns: np.ndarray, information: np.ndarray, gradient: np.ndarray) -> None:
        """Add m sums: columns (m, c) as in `add`, information (m, c, c), gradient (m, c)."""
        columns = np.where(columns < 0, self.size, columns)
        summed = np.bincount(columns.ravel(), gradient.ravel(), self.size + 1)[: self.size]
        self.gradient = self.gradient + summed
        self._columns.append(columns)
        self._blocks.append(information)

    def dense(self) -> np.ndarray:
        """Return the information as (size, size), for problems of bounded size."""
        side, result = self.size + 1, np.zeros((self.size + 1) ** 2)
        for columns, block in zip(self._columns, self._blocks):
            places = columns[:, :, np.newaxis] * side + columns[:, np.newaxis]
            result += np.bincount(places.ravel(), block.ravel(), side * side)
        return result.reshape(side, side)[: self.size, : self.size] + _REGULARISATION * np.eye(self.size)

    def sparse(self) -> scipy.sparse.csc_matrix:
        """Return the information as a sparse matrix (size, size)."""
        side = self.size + 1
        rows = [np.repeat(columns, columns.shape[1], axis=1).ravel() for columns in self._columns]
        across = [np.tile(columns, (1, columns.shape[1])).ravel() for columns in self._columns]
        values = np.concatenate([block.ravel() for block in self._blocks])
        places = (np.concatenate(rows), np.concatenate(across))
        whole = scipy.sparse.coo_matrix((values, places), (side, side)).tocsc()
        return (whole[: self.size, : self.size] + _REGULARISATION * scipy.sparse.eye(self.size)).tocsc()


class DenseSolution:
    """Solves normal equations of bounded size, and tells covariances."""

    def __init__(self, equations: NormalEquations) -> None:
        self._factor = scipy.linalg.cho_factor(equations.dense())
        self.step = -scipy.linalg.cho_solve(self._factor, equations.gradient)

    def solve(self, right: np.ndarray) -> np.ndarray:
        """Return the inverse of the information times `right` (size, k)."""
        return scipy.linalg.cho_solve(self._factor, right)


class SparseSolution:
    """Solves normal equations of a whole run, and tells covariances."""

    def __init__(self, equations: NormalEquations) -> None:
        self._factor = scipy.sparse.linalg.splu(equations.sparse())
        self.step = -self._factor.solve(equations.gradient)

    def solve(self, right: np.ndarray) -> np.ndarray:
        """Return the inverse of the information times `right` (size, k)."""
        return self._factor.solve(right)
