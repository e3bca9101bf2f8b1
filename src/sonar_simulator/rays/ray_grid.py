"""Contacts from a grid of measured ranges, as Gazebo's ray sensor publishes it."""

from typing import Optional, Tuple

import numpy as np

from sonar_simulator.rays.contacts import Contacts
from sonar_simulator.world.materials import DEFAULT_MATERIAL, Material, material_of_reflection


def contacts_of_grid(
    ranges: np.ndarray, elevations: np.ndarray, bearings: np.ndarray, retro: Optional[np.ndarray] = None
) -> Contacts:
    """Return the contacts of one beam.

    ranges: (rows, columns) m; values not finite or not above 0 mean that nothing was hit. elevations: (rows,) and
    bearings: (columns,) rad off the beam's axis, up and left positive. retro: (rows, columns) share of pressure
    reflected, 0 to 1, as in <laser_retro>; 0 or None: the default material. Incidence angles follow from neighbours in
    the grid; with one row, surfaces count as vertical; with one column, as perpendicular to the beam. Raises ValueError
    for shapes that do not fit together.
    """
    ranges = np.asarray(ranges, dtype=np.float64)
    if ranges.shape != (len(elevations), len(bearings)):
        raise ValueError(f"ranges {ranges.shape}, must be {len(elevations)} elevations x {len(bearings)} bearings")
    ranges = np.where(np.isfinite(ranges), ranges, np.inf)
    ranges = np.where(ranges > 0.0, ranges, np.inf)
    level = np.cos(elevations)[:, np.newaxis]
    rising = np.broadcast_to(np.sin(elevations)[:, np.newaxis], ranges.shape)
    directions = np.stack([level * np.cos(bearings), level * np.sin(bearings), rising], axis=-1)
    material, materials = _materials(ranges.shape, retro)
    return Contacts.of_ranges(
        ranges.reshape(1, -1),
        directions.reshape(1, -1, 3),
        _cosines(ranges, directions).reshape(1, -1),
        material.reshape(1, -1),
        materials,
    )


def _cosines(ranges: np.ndarray, directions: np.ndarray) -> np.ndarray:
    """Return |cos| of the incidence angles (rows, columns), 1 where neighbours are missing."""
    hit = np.isfinite(ranges)
    points = np.where(hit, ranges, 0.0)[..., np.newaxis] * directions
    up = _tangents(points, hit, axis=0) if len(ranges) > 1 else np.broadcast_to([0.0, 0.0, 1.0], points.shape)
    left = _tangents(points, hit, axis=1) if ranges.shape[1] > 1 else np.broadcast_to([0.0, 1.0, 0.0], points.shape)
    normals = np.cross(left, up)
    lengths = np.linalg.norm(normals, axis=-1)
    lengths = np.where(np.isfinite(lengths), lengths, 0.0)
    known = hit & (lengths > 0.0)
    cosines = np.abs(np.einsum("...i,...i", normals, directions)) / np.where(known, lengths, 1.0)
    return np.where(known, np.minimum(cosines, 1.0), 1.0)


def _tangents(points: np.ndarray, hit: np.ndarray, axis: int) -> np.ndarray:
    """Return the step to the nearer of the two neighbours along an axis; the other may be on a different surface."""
    points, hit = np.moveaxis(points, axis, 0), np.moveaxis(hit, axis, 0)
    steps = np.where((hit[1:] & hit[:-1])[..., np.newaxis], points[1:] - points[:-1], np.nan)
    none = np.full((1, *points.shape[1:]), np.nan)
    before, after = np.concatenate([none, steps]), np.concatenate([steps, none])
    lengths_before, lengths_after = (_lengths_or_infinite(each) for each in (before, after))
    first = (lengths_before < lengths_after) | np.isinf(lengths_after)
    return np.moveaxis(np.where(first[..., np.newaxis], before, after), 0, axis)


def _lengths_or_infinite(steps: np.ndarray) -> np.ndarray:
    """Return the lengths of steps (..., 3), inf for a missing one: numpy 1.17 warns where NaN is compared."""
    return np.where(np.isnan(steps[..., 0]), np.inf, np.linalg.norm(steps, axis=-1))


def _materials(shape: Tuple[int, ...], retro: Optional[np.ndarray]) -> Tuple[np.ndarray, Tuple[Material, ...]]:
    if retro is None:
        return np.zeros(shape, dtype=np.intp), (DEFAULT_MATERIAL,)
    reflected = np.clip(np.nan_to_num(np.asarray(retro, dtype=np.float64)), 0.0, 1.0)
    values, index = np.unique(reflected, return_inverse=True)
    materials = tuple(material_of_reflection(float(v)) if v > 0.0 else DEFAULT_MATERIAL for v in values)
    return index.reshape(shape), materials
