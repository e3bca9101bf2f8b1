"""Grids of rays, as Gazebo's ray sensors send them, and the contacts of a beam made of them."""

import math
from dataclasses import dataclass
from typing import Any, Optional, Tuple

import numpy as np

from node_support.errors import RefusedInput
from node_support.geometry import bearings_of
from sonar_simulator.echoes.beam_tracer import Contacts
from sonar_simulator.world.world import DEFAULT_MATERIAL, Material, material_of_reflection

_NO_BEARING = 1e-6  # rad: less than any ray sensor's step; all rays of one column


@dataclass(frozen=True)
class Rays:
    """A grid of rays around the sensor's +x: (rows, columns) ranges, m, inf where nothing was hit.

    elevations: (rows,) above the sensor's x-y plane; bearings: (columns,) counter-clockwise about its +z; rad.
    retro: (rows, columns) laser_retro of what was hit, or None if the sensor does not provide it.
    """

    ranges: np.ndarray
    elevations: np.ndarray
    bearings: np.ndarray
    retro: Optional[np.ndarray]

    def within(self, bearing: float, opening: float) -> "Rays":
        """Return the columns within `opening` rad (full width) around `bearing`, with bearings relative to it.

        Raises RefusedInput when there are none.
        """
        off = np.remainder(self.bearings - bearing + math.pi, 2.0 * math.pi) - math.pi
        inside = np.flatnonzero(np.abs(off) <= 0.5 * opening + 1e-9)
        if not len(inside):
            raise RefusedInput(
                "scans refused",
                f"no ray within {math.degrees(opening):.2f} deg of {math.degrees(bearing):.1f} deg: the sensor must "
                "reach around the whole circle, with rays closer together than the beam is wide",
            )
        columns = inside[np.argsort(off[inside])]
        retro = None if self.retro is None else self.retro[:, columns]
        return Rays(self.ranges[:, columns], self.elevations, off[columns], retro)


def rays_of_scan(scan: Any, vertical_opening: float) -> Rays:
    """Return the rays of a LaserScan as gazebo_ros_laser publishes it: the rows of a pyramid, one after the other.

    Its ranges are inf or at least range_max where nothing was hit, -inf where something was too near, its intensities
    laser_retro, if there are any. vertical_opening: rad from the lowest row to the highest, which the message does not
    contain. Raises RefusedInput.
    """
    columns, count = _columns(scan), len(scan.ranges)
    if not count or count % columns:
        raise RefusedInput(
            "scans refused",
            f"{count} ranges are not a multiple of the {columns} columns between angle_min and angle_max",
        )
    rows = count // columns
    grid = np.asarray(scan.ranges, dtype=np.float64).reshape(rows, columns)
    has_retro, half = len(scan.intensities) == count, 0.5 * vertical_opening
    retro = np.asarray(scan.intensities, dtype=np.float64).reshape(rows, columns) if has_retro else None
    return Rays(
        _without_misses(grid, scan.range_max), np.linspace(-half, half, rows) if rows > 1 else np.zeros(1),
        np.linspace(scan.angle_min, scan.angle_max, columns), retro,
    )  # fmt: skip


def _columns(scan: Any) -> int:
    """Return the number of rays in a row of a LaserScan; raises RefusedInput if its angles are inconsistent."""
    span = scan.angle_max - scan.angle_min
    if not (math.isfinite(span) and math.isfinite(scan.angle_increment)):
        raise RefusedInput("scans refused", f"angles {scan.angle_min} to {scan.angle_max}, must be finite")
    # For a single ray, Gazebo publishes an increment that cannot be used as a divisor.
    if abs(scan.angle_increment) < _NO_BEARING:
        return 1
    columns = round(span / scan.angle_increment) + 1
    if columns < 1:
        raise RefusedInput("scans refused", f"angle_increment {scan.angle_increment} does not lead to angle_max")
    return columns


def rays_of_points(points: np.ndarray, intensities: Optional[np.ndarray], rows: int, nothing_range: float) -> Rays:
    """Return the rays of a point cloud as gazebo_ros_block_laser publishes it: one point per ray, row after row.

    points: (n, 3) m in the sensor's frame. rows: their number; 0 to derive it from the points, for a
    pyramid narrower than 180 deg. A ray that hits nothing gives a point at `nothing_range` m, or farther, which is the
    sensor's greatest range minus its smallest. Raises RefusedInput if the points are not such a grid.
    """
    points = np.asarray(points, dtype=np.float64).reshape(-1, 3)
    distances = np.linalg.norm(points, axis=1)
    if not len(points) or not np.isfinite(points).all() or not distances.all():
        raise RefusedInput(
            "scans refused",
            f"{len(points)} points; there must be at least one, all finite and none at the sensor's centre",
        )
    bearings = bearings_of(points)
    rows = rows or _row_count(bearings)
    if len(points) % rows:
        raise RefusedInput("scans refused", f"{len(points)} points are not {rows} rows")
    shape = (rows, len(points) // rows)
    elevations = np.arcsin(points[:, 2] / distances).reshape(shape)
    retro = None if intensities is None else np.asarray(intensities, dtype=np.float64).reshape(shape)
    return Rays(
        _without_misses(distances.reshape(shape), nothing_range), np.median(elevations, axis=1),
        np.median(np.unwrap(bearings.reshape(shape), axis=1), axis=0), retro,
    )  # fmt: skip


def _row_count(bearings: np.ndarray) -> int:
    """Return the number of rows: how often the bearing returns to the beginning of a row, plus one."""
    span = np.ptp(bearings)
    if span > math.pi:
        raise RefusedInput("scans refused", "rows are unknown for points all around the sensor; set ray_rows")
    if span <= _NO_BEARING:
        return len(bearings)
    steps = np.diff(bearings)
    return int(np.count_nonzero(steps * np.sign(steps[0]) < -0.5 * span)) + 1


def _without_misses(ranges: np.ndarray, nothing_range: float) -> np.ndarray:
    """Replace ranges without a hit by inf; allows for the single precision of clouds."""
    ranges = np.where(np.isnan(ranges), np.inf, ranges)
    hit = (ranges > 0.0) & (ranges < nothing_range * (1.0 - 1e-6) - 1e-6)
    return np.where(hit, ranges, np.inf)


def contacts_of_grid(rays: Rays) -> Contacts:
    """Return the contacts of one beam, whose axis the angles of its rays are off, up and left positive.

    A retro is the share of pressure reflected, 0 to 1, as in <laser_retro>; 0 or None: the default material. Incidence
    angles follow from neighbours in the grid; with one row, surfaces count as vertical; with one column, as
    perpendicular to the beam.
    """
    ranges, bearings = rays.ranges, rays.bearings
    level = np.cos(rays.elevations)[:, np.newaxis]
    rising = np.broadcast_to(np.sin(rays.elevations)[:, np.newaxis], ranges.shape)
    directions = np.stack([level * np.cos(bearings), level * np.sin(bearings), rising], axis=-1)
    material, materials = _materials(ranges.shape, rays.retro)
    return Contacts.of_ranges(
        ranges.reshape(1, -1), directions.reshape(1, -1, 3), _cosines(ranges, directions).reshape(1, -1),
        material.reshape(1, -1), materials,
    )  # fmt: skip


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
