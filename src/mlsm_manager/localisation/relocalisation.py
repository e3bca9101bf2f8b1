"""Finds a vehicle that lost its place: one scan against the whole map."""

import numpy as np

from mlsm_manager.scan_matching.distribution_matcher import DistributionMatcher, DistributionMatcherParameters
from mlsm_manager.scan_matching.prediction import OdometryErrors
from mlsm_manager.scan_matching.result import Matcher, MatchResult, Prior
from mlsm_manager.scan_matching.scan import Scan
from mlsm_manager.scan_matching.scan_path import YAW, X, Y
from mlsm_manager.surface_map.blocks import BlockSource, all_of
from node_support.geometry import composed, inverse

# Up to 500 m away with any heading; a cell of 1 m keeps the search within seconds, and 80 candidates make up for it.
# A wrong place costs a lost vehicle more than none: it must be e^6 times as likely as the next.
_EVERYWHERE = {
    "search_distance": 500.0, "search_angle": np.pi, "search_cell": 1.0, "candidates": 80, "min_gain_over_second": 6.0
}  # fmt: skip


def relocaliser(parameters: DistributionMatcherParameters) -> Matcher:
    """Return the default matcher, made to look everywhere."""
    return DistributionMatcher(parameters.changed(_EVERYWHERE))


def relocalised(scan: Scan, target: BlockSource, matcher: Matcher, errors: OdometryErrors) -> MatchResult:
    """Return where in the whole map `scan` was taken, whatever was believed before."""
    target = all_of(target)
    centers = target.mean[:, :2] if len(target) else np.zeros((1, 2))
    low, high = centers.min(axis=0), centers.max(axis=0)
    middle = np.append((low + high) / 2.0, scan.reference_pose[2])
    covariance = errors.covariance()
    covariance[X, X] = covariance[Y, Y] = (float((high - low).max()) / 4.0 + 1.0) ** 2
    covariance[YAW, YAW] = np.pi**2
    correction = composed(middle, inverse(scan.reference_pose))
    return matcher.match(scan, target, Prior(correction, np.zeros(3), np.zeros(2), covariance))
