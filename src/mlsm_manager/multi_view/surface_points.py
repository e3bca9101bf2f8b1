"""Points of a scan that lie on a surface, as the sonar heard them: range, bearing and the surface's normal."""

from dataclasses import dataclass, fields
from typing import Sequence, Tuple

import numpy as np
from scipy.spatial import cKDTree

from mlsm_manager.matching.planar import inverse, rotated, transformed
from mlsm_manager.matching.scan import Scan

_NEIGHBOURS = 10  # enough for a line with the noise of dense echoes, few enough to stay on one wall
_FEWEST = 5  # a line through fewer points says little about its direction
_FLATNESS = 0.3  # variance across over variance along: above it the points are a heap and no line
_REACH = 2.0  # m: neighbours at short range
_REACH_PER_RANGE = 0.12  # rad: beams fan out; about four steps of a head with 1.8 deg


@dataclass(frozen=True)
class SurfacePoints:
    """n points that lie on surfaces.

    times: (n,) s, stamps of their beams. ranges: (n,) m from the sonar as reported. bearings: (n,) rad from the sonar,
    in base_link. normals: (n, 2) of the surface in base_link at the point's own time, pointing away from the sonar.
    slants: (n,) m, range times the sine of the angle of incidence.
    """

    times: np.ndarray
    ranges: np.ndarray
    bearings: np.ndarray
    normals: np.ndarray
    slants: np.ndarray

    def __len__(self) -> int:
        return len(self.times)

    @classmethod
    def joined(cls, parts: Sequence["SurfacePoints"]) -> "SurfacePoints":
        """Return the points of all `parts`, at least one."""
        return cls(*(np.concatenate([getattr(part, field.name) for part in parts]) for field in fields(cls)))

    @classmethod
    def of(cls, scan: Scan, sonar_in_base: np.ndarray) -> "SurfacePoints":
        """Return the points of a scan that lie on surfaces; sonar_in_base: (2,) m, where the sonar is in base_link."""
        poses = scan.track.at(scan.times)
        normals, known = surface_normals(scan.points[:, :2], poses, sonar_in_base)
        poses, seen = poses[known], scan.points[known][:, :2]
        sight = transformed(inverse(poses), seen)[:, :2] - sonar_in_base
        normals = rotated(normals[known], -poses[:, 2])
        normals = normals * np.where(np.einsum("na,na->n", normals, sight) < 0.0, -1.0, 1.0)[:, np.newaxis]
        slants = np.abs(sight[:, 0] * normals[:, 1] - sight[:, 1] * normals[:, 0])
        return cls(
            scan.times[known], np.hypot(sight[:, 0], sight[:, 1]), np.arctan2(sight[:, 1], sight[:, 0]), normals, slants
        )


def surface_normals(points: np.ndarray, poses: np.ndarray, sonar_in_base: np.ndarray) -> Tuple[np.ndarray, np.ndarray]:
    """Return unit normals (n, 2) of the lines that points (n, 2) lie on, and (n,) where they do lie on one.

    poses: (n, 3) T_odom_base when each point was heard.
    """
    if len(points) < _FEWEST:
        return np.zeros((len(points), 2)), np.zeros(len(points), dtype=bool)
    sonar = poses[:, :2] + rotated(np.broadcast_to(sonar_in_base, (len(points), 2)), poses[:, 2])
    reach = np.maximum(_REACH, _REACH_PER_RANGE * np.hypot(*(points - sonar).T))
    distance, index = cKDTree(points).query(points, k=min(_NEIGHBOURS, len(points)))
    near = distance <= reach[:, np.newaxis]
    count = near.sum(axis=1)
    group = points[np.where(near, index, 0)]
    mean = (group * near[..., np.newaxis]).sum(axis=1) / count[:, np.newaxis]
    offset = (group - mean[:, np.newaxis]) * near[..., np.newaxis]
    covariance = np.einsum("nka,nkb->nab", offset, offset) / count[:, np.newaxis, np.newaxis]
    values, vectors = np.linalg.eigh(covariance)
    return vectors[:, :, 0], (count >= _FEWEST) & (values[:, 0] < _FLATNESS * values[:, 1])
