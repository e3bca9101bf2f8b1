"""Scans that have no place in the map, or not one only: no fix may be accepted that excludes the truth."""

from typing import Callable, Dict, List, Tuple

import numpy as np

from benchmarks.matching_scans import KINDS, ScanMaker, SonarKind, noise_scan, still
from benchmarks.matching_starts import tour_map
from benchmarks.table import Row
from mlsm_manager.scan_matching.distribution_matcher import DistributionMatcher, DistributionMatcherParameters
from mlsm_manager.scan_matching.result import Prior
from mlsm_manager.scan_matching.scan import Scan
from mlsm_manager.surface_map.blocks import Blocks
from mlsm_manager.surface_map.mlsm import MultiLevelSurfaceMap
from node_support.geometry import composed, inverse

SCANS = 250
_SIGMAS = 4.0
_DEVIATIONS = np.array([1.5, 1.5, 0.15, 1e-3, 1e-3, 1e-4, 1e-3, 1e-3])
Case = Tuple[Scan, Blocks, np.ndarray]
"""A scan, a map and the true pose (3,) in it."""


def cases(kind: SonarKind) -> Dict[str, Callable[[int], Case]]:
    """Return for each situation what makes its case number n."""
    basin = tour_map(ScanMaker("basin", kind))
    makers = {name: ScanMaker(name, kind) for name in ("basin", "empty sea", "straight wall")}

    def alone(world: str, seed: int) -> Case:
        rng = np.random.default_rng(seed)
        first, second = np.zeros(3), rng.uniform([-5.0, -2.0, -0.2], [5.0, 2.0, 0.2])
        surface_map = MultiLevelSurfaceMap(0.5)
        surface_map.insert(makers[world].scan(still(first), still(first), 2 * seed).points)
        return makers[world].scan(still(second), still(second), 2 * seed + 1), surface_map.blocks, second

    def noise(seed: int) -> Case:
        return noise_scan(int(np.random.default_rng(seed).integers(30, 300)), seed), basin, np.zeros(3)

    def elsewhere(seed: int) -> Case:
        rng = np.random.default_rng(seed)
        believed = rng.uniform([-45.0, -12.0, -3.1], [45.0, 12.0, 3.1])
        true = np.array([-np.sign(believed[0]) * rng.uniform(20.0, 45.0), rng.uniform(-12.0, 12.0), believed[2] + 1.6])
        scan = makers["basin"].scan(still(true), still(believed), seed)
        return scan, basin, true

    return {
        "an empty sea": lambda seed: alone("empty sea", seed),
        "a single straight wall": lambda seed: alone("straight wall", seed),
        "pure noise": noise,
        "a map of another place": elsewhere,
    }


def false_rows(kind: SonarKind, first_seed: int = 0) -> List[Row]:
    """Return how many scans were accepted with a covariance that excludes the truth."""
    matcher = DistributionMatcher(DistributionMatcherParameters())
    rows: List[Row] = []
    for title, make in cases(kind).items():
        seeds = range(first_seed, first_seed + SCANS)
        outcomes = [_outcome(matcher, make(seed), seed) for seed in seeds]
        wrong, accepted = sum(o[0] for o in outcomes), sum(o[1] for o in outcomes)
        text = f"{wrong} of {SCANS} ({accepted} accepted)"
        rows.append((f"false fixes on {title}, {kind}", text, "0"))
    return rows


def _outcome(matcher: DistributionMatcher, case: Case, seed: int) -> Tuple[bool, bool]:
    scan, target, true = case
    rng = np.random.default_rng(seed)
    expected = scan.reference_pose + rng.normal(0.0, _DEVIATIONS[:3])
    prior = Prior(composed(expected, inverse(scan.reference_pose)), np.zeros(3), np.zeros(2), np.diag(_DEVIATIONS**2))
    result = matcher.match(scan, target, prior)
    if not result.accepted:
        return False, False
    difference = result.pose - true
    squared = difference @ np.linalg.solve(result.covariance[:3, :3], difference)
    return bool(squared > _SIGMAS**2), True


def rows(first_seed: int = 0) -> List[Row]:
    """Return the figures of false fixes."""
    return [row for kind in KINDS for row in false_rows(kind, first_seed)]
