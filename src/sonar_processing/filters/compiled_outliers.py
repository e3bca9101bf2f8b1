"""The rules of `outliers`, by a compiled search for neighbours; they keep the same points. Needs numba."""

import numpy as np

from sonar_processing.filters.compiled_neighbors import have_neighbors, mean_distances
from sonar_processing.filters.outliers import not_above_limit


def statistical_inliers(points: np.ndarray, mean_k: int, stddev_multiplier: float) -> np.ndarray:
    """Return (n,) bool as outliers.statistical_inliers does for points (n, 3), finite."""
    if len(points) < 3:
        return np.ones(len(points), dtype=bool)
    distances = mean_distances(np.ascontiguousarray(points, dtype=np.float64), min(mean_k, len(points) - 1))
    return not_above_limit(distances, stddev_multiplier)


def radius_inliers(points: np.ndarray, radius: float, min_neighbors: int) -> np.ndarray:
    """Return (n,) bool as outliers.radius_inliers does for points (n, 3), finite."""
    return have_neighbors(np.ascontiguousarray(points, dtype=np.float64), radius, min_neighbors)
