"""What estimates say of whole turns of the head, which may have been cut into parts."""

from typing import NamedTuple, Sequence

import numpy as np

from mlsm_manager.joint_solver.placing.estimate import LiveEstimate


class Turns(NamedTuple):
    """n turns. times: (n,) s of their ends. agreements: (n,), surfaces: (n, 2, 2), see LiveEstimate. radii: (n,) m,
    told deviation of the position. apart: (n,) bool, whether their place in the map is not known.
    """

    times: np.ndarray
    agreements: np.ndarray
    surfaces: np.ndarray
    radii: np.ndarray
    apart: np.ndarray

    @classmethod
    def of(cls, estimates: Sequence[LiveEstimate], apart: np.ndarray, parts: int) -> "Turns":
        """Return those of `estimates` and `apart`, both (n parts,), `parts` of which belong to each turn."""
        ends = estimates[parts - 1 :: parts]
        return cls(
            times=np.array([estimate.time for estimate in ends]),
            agreements=np.array([estimate.agreement for estimate in estimates]).reshape(-1, parts).mean(axis=1),
            surfaces=np.array([estimate.surfaces for estimate in estimates]).reshape(-1, parts, 2, 2).sum(axis=1),
            radii=np.sqrt([np.trace(estimate.pose_covariance[:2, :2]) for estimate in ends]),
            apart=apart[parts - 1 :: parts],
        )

    @classmethod
    def with_echoes(
        cls, estimates: Sequence[LiveEstimate], apart: np.ndarray, parts: int, point_counts: np.ndarray, most: int
    ) -> "Turns":
        """Return the newest `most` turns in which surfaces were heard; point_counts: (n parts,) of the scans."""
        heard = np.flatnonzero(point_counts.reshape(-1, parts).any(axis=1))[-most:]
        scans = (heard[:, np.newaxis] * parts + np.arange(parts)).ravel()
        return cls.of([estimates[scan] for scan in scans], apart[scans], parts)
