"""Where single scans were found in the map, while the solver itself hardly knows how far the vehicle goes."""

from dataclasses import dataclass, field
from typing import Dict, Mapping

import numpy as np

from mlsm_manager.joint_solver.normal_equations import YAW, Layout, NormalEquations

_NODES, _PLACES, _INFORMATION = "fix_nodes", "fix_places", "fix_information"  # the names in stored maps


@dataclass(frozen=True)
class Fix:
    """place: (2,) m in map at the end of a scan. information: (2, 2) its inverse covariance. The compass tells yaw."""

    place: np.ndarray
    information: np.ndarray

    @classmethod
    def without_prior(
        cls, place: np.ndarray, covariance: np.ndarray, expected: np.ndarray, prior_covariance: np.ndarray
    ) -> "Fix":
        """Return what a scan itself says, if `place` (2,) with its covariance (2, 2) also holds what was expected."""
        of_both, of_prior = np.linalg.inv(covariance), np.linalg.inv(prior_covariance)
        values, vectors = np.linalg.eigh(of_both - of_prior)
        information = vectors @ np.diag(np.maximum(values, 0.0)) @ vectors.T
        return cls(np.linalg.pinv(information) @ (of_both @ place - of_prior @ expected), information)


@dataclass
class Fixes:
    """Those of a run, by the node at the end of the scan."""

    by_node: Dict[int, Fix] = field(default_factory=dict)

    def add(self, equations: NormalEquations, layout: Layout, poses: np.ndarray, corrections: np.ndarray) -> None:
        """Add those of the free nodes. poses: (n, 3) T_odom_base, corrections: (n, width), of these nodes."""
        for node, fix in self.by_node.items():
            if layout.first <= node <= layout.last:
                row = node - layout.first
                gradient = fix.information @ (poses[row, :YAW] + corrections[row, :YAW] - fix.place)
                columns = layout.node_start(node) + np.arange(YAW)
                equations.add_terms(columns[np.newaxis], fix.information[np.newaxis], gradient[np.newaxis])

    def stored(self) -> Dict[str, np.ndarray]:
        """Return what `of_arrays` needs, by name."""
        fixes = self.by_node.values()
        return {
            _NODES: np.array(list(self.by_node), dtype=np.int64),
            _PLACES: np.array([fix.place for fix in fixes]).reshape(-1, YAW),
            _INFORMATION: np.array([fix.information for fix in fixes]).reshape(-1, YAW, YAW),
        }

    @classmethod
    def of_arrays(cls, stored: Mapping[str, np.ndarray]) -> "Fixes":
        """Return what was `stored`. Raises KeyError."""
        arrays = (stored[name] for name in (_NODES, _PLACES, _INFORMATION))
        return cls({int(node): Fix(place, information) for node, place, information in zip(*arrays)})
