"""How far points are from triangles."""

import numpy as np

_CHUNK = 200_000  # Pairs of point and triangle at once: bounds the memory


def triangle_distances(corners: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Return (n,) distances [m] of points (n, 3) from the nearest of the triangles with `corners` (m, 3, 3)."""
    step = max(1, _CHUNK // max(len(corners), 1))
    parts = [points[start : start + step] for start in range(0, len(points), step)]
    return np.concatenate([np.empty(0), *(_nearest(corners, part) for part in parts)])


def _nearest(corners: np.ndarray, points: np.ndarray) -> np.ndarray:
    from_edges = [_from_segments(corners[:, a], corners[:, b], points) for a, b in ((0, 1), (1, 2), (2, 0))]
    return np.minimum(np.min(from_edges, axis=(0, 2)), _from_faces(corners, points).min(axis=1))


def _from_segments(start: np.ndarray, end: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Return (n, m) distances of points from segments."""
    along = end - start
    lengths = np.maximum((along**2).sum(axis=1), np.finfo(np.float64).tiny)
    offset = points[:, np.newaxis] - start
    share = np.clip(np.einsum("nmi,mi->nm", offset, along) / lengths, 0.0, 1.0)
    return np.linalg.norm(offset - share[..., np.newaxis] * along, axis=2)


def _from_faces(corners: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Return (n, m) distances from the triangles' planes, infinite where the foot lies beside the triangle."""
    first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    normal = np.cross(first, second)
    squared = (normal**2).sum(axis=1)
    has_area = squared > 0.0
    squared = np.where(has_area, squared, 1.0)
    offset = points[:, np.newaxis] - corners[:, 0]
    v = np.einsum("nmi,mi->nm", np.cross(offset, second), normal) / squared
    w = np.einsum("nmi,mi->nm", np.cross(first, offset), normal) / squared
    height = np.abs(np.einsum("nmi,mi->nm", offset, normal)) / np.sqrt(squared)
    return np.where(has_area & (v >= 0.0) & (w >= 0.0) & (v + w <= 1.0), height, np.inf)
