"""Removes points that stand alone, with the semantics of the Point Cloud Library (thesis 6.5.4)."""

from dataclasses import dataclass
from enum import Enum

import numpy as np
from scipy.spatial import cKDTree

from node_support.parameters import ParameterSet, parameter
from sonar_processing.cloud import Cloud


class OutlierMode(Enum):
    STATISTICAL = "STATISTICAL"
    RADIUS = "RADIUS"
    NONE = "NONE"


@dataclass(frozen=True)
class OutlierRemoverParameters(ParameterSet):
    mode: OutlierMode = parameter(OutlierMode.STATISTICAL, "which rule removes points", thesis_name="mode")
    mean_k: int = parameter(
        20, "STATISTICAL: nearest neighbours whose mean distance counts", low=1, high=1000, thesis_name="meanK"
    )
    stddev_multiplier: float = parameter(
        1.0,
        "STATISTICAL: points are kept up to so many standard deviations above the mean of these distances",
        low=0.0, high=100.0, thesis_name="stddevMulThresh",
    )  # fmt: skip
    min_radius: float = parameter(
        1.0, "RADIUS: distance within which neighbours are counted", unit="m", low=0.001, high=1000.0,
        thesis_name="minRadius",
    )  # fmt: skip
    min_neighbors: int = parameter(
        20, "RADIUS: a point with fewer neighbours is removed", low=1, high=10000, thesis_name="minNeighbours"
    )


class OutlierRemover:
    """Applies the configured rule to the finite points of a cloud."""

    def __init__(self, parameters: OutlierRemoverParameters) -> None:
        self.parameters = parameters

    def __call__(self, cloud: Cloud) -> Cloud:
        parameters = self.parameters
        if parameters.mode is OutlierMode.NONE:
            return cloud
        keep = cloud.valid
        points = cloud.points[keep, :3]
        if parameters.mode is OutlierMode.STATISTICAL:
            keep[keep] = statistical_inliers(points, parameters.mean_k, parameters.stddev_multiplier)
        else:
            keep[keep] = radius_inliers(points, parameters.min_radius, parameters.min_neighbors)
        return cloud.select(keep)


def statistical_inliers(points: np.ndarray, mean_k: int, stddev_multiplier: float) -> np.ndarray:
    """Return (n,) bool: whose mean distance to the `mean_k` nearest others is not above mean + multiplier * sd.

    points: (n, 3), finite. The standard deviation is the sample's (n - 1), as in pcl::StatisticalOutlierRemoval. With
    fewer than `mean_k` others, all others count; fewer than three points have no outlier.
    """
    if len(points) < 3:
        return np.ones(len(points), dtype=bool)
    # Splitting in the middle instead of at the median builds ten times as fast; the neighbours are the same.
    tree = cKDTree(points, balanced_tree=False, compact_nodes=False)
    distances, _ = tree.query(points, k=min(mean_k, len(points) - 1) + 1)
    means = distances[:, 1:].mean(axis=1)
    # Above the smallest, for the mean of equal numbers may round to less than each of them.
    excess = means - means.min()
    return excess <= excess.mean() + stddev_multiplier * excess.std(ddof=1)


def radius_inliers(points: np.ndarray, radius: float, min_neighbors: int) -> np.ndarray:
    """Return (n,) bool: which points have at least `min_neighbors` others within `radius` [m], border included.

    points: (n, 3), finite. pcl::RadiusOutlierRemoval counts the point itself and keeps more than `min_neighbors`; it
    computes squared distances in float32 and compares them with the squared radius in float64, so points on the border
    are decided that way here too.
    """
    if len(points) == 0:
        return np.ones(0, dtype=bool)
    points = np.ascontiguousarray(points, dtype=np.float32)
    tree = cKDTree(points, balanced_tree=False)
    slack = 1e-5 * radius + 1e-6
    surely = tree.query_ball_point(points, max(radius - slack, 0.0), return_length=True) > min_neighbors
    if surely.all():
        # scipy 1.3 raises for a query without points.
        return surely
    unsure = np.flatnonzero(~surely)
    possibly = tree.query_ball_point(points[unsure], radius + slack, return_length=True) > min_neighbors
    for index in unsure[possibly]:
        squares = (points[tree.query_ball_point(points[index], radius + slack)] - points[index]) ** 2
        squared_distances = ((squares[:, 0] + squares[:, 1]) + squares[:, 2]).astype(np.float64)
        surely[index] = np.count_nonzero(squared_distances <= radius * radius) > min_neighbors
    return surely
