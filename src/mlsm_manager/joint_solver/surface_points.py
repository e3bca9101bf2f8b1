"""Points of a scan on surfaces, or alone as of posts: range, bearing and normal as the sonar heard them."""

from dataclasses import dataclass, fields
from typing import NamedTuple, Sequence, Tuple

import numpy as np
from scipy.spatial import cKDTree

from mlsm_manager.scan_matching.scan import Scan
from node_support.geometry import bearings_of, inverse, rotated, transformed, wrapped
from sonar_processing.filters.threshold import height_threshold

_NEIGHBOURS = 12  # enough for a line with the noise of dense echoes, few enough to stay on one wall
LEAST_REACH = 2.3  # m: neighbours at short range, and of points that no beam is known of
_REACH_STEPS = 4.45  # steps of the head, because beams fan out: eight neighbours on a wall that each beam hears
_REACH_ANGLES = (0.14, 0.35)  # rad: least and most of what the steps come to, of heads with 1.8 and 4.5 deg
_STEP_QUANTILE = 0.25  # of the angles between beams with echoes: some of these are several steps apart
_NEAR = 0.75  # share of the reach within which a neighbour counts fully; from there to the reach it fades out
_FEWEST = (4.0, 5.0)  # neighbours, the point included: from no line at all to a line
_FLATNESS = (0.35, 0.25)  # variance across over variance along: from a heap to a line
_ECHO_LENGTH = (3.0, 2.0)  # m: from points of a beam that tell of two surfaces to points of one echo
_NOTHING = 1e-9  # m: keeps points on top of each other, or of the sonar, from dividing by zero
_GRAZING = (0.02, 0.1)  # cosine of incidence: from no telling which side of a surface was heard to certainty


class Sights(NamedTuple):
    """The points of a scan as the sonar saw them.

    places: (n, 2) m from the sonar, in base_link at their own times. ranges: (n,) m. bearings: (n,) rad. reach: (n,) m,
    see `reaches`. per_echo: (n,), see `points_per_echo`.
    """

    places: np.ndarray
    ranges: np.ndarray
    bearings: np.ndarray
    reach: np.ndarray
    per_echo: np.ndarray

    @classmethod
    def of(cls, scan: Scan, sonar_in_base: np.ndarray) -> "Sights":
        """Return those of a scan; sonar_in_base: (2,) m, where the sonar is in base_link."""
        places = transformed(inverse(scan.track.at(scan.times)), scan.points[:, :2]) - sonar_in_base
        ranges, bearings = np.hypot(places[:, 0], places[:, 1]), bearings_of(places)
        reach, per_echo = reaches(scan.times, bearings, ranges), points_per_echo(scan.times, ranges)
        return cls(places, ranges, bearings, reach, per_echo)


@dataclass(frozen=True)
class SurfacePoints:
    """n points that lie on surfaces.

    times: (n,) s, stamps of their beams. ranges: (n,) m from the sonar as reported. bearings: (n,) rad from the sonar,
    in base_link. normals: (n, 2) of the surface in base_link at the point's own time, pointing away from the sonar.
    slants: (n,) m, range times the sine of the angle of incidence. qualities: (n,) from above 0 to 1, how certainly the
    point lies on a surface; what makes a point drop out takes its quality to 0 first, so that nothing hangs on a
    rounding error.
    """

    times: np.ndarray
    ranges: np.ndarray
    bearings: np.ndarray
    normals: np.ndarray
    slants: np.ndarray
    qualities: np.ndarray

    def __len__(self) -> int:
        return len(self.times)

    @classmethod
    def joined(cls, parts: Sequence["SurfacePoints"]) -> "SurfacePoints":
        return cls(*(np.concatenate([getattr(part, field.name) for part in parts]) for field in fields(cls)))

    @classmethod
    def of(cls, scan: Scan, sights: Sights) -> "SurfacePoints":
        sight, ranges, bearings, reach, per_echo = sights
        normals, qualities = surface_normals(scan.points[:, :2], reach)
        normals = rotated(normals, -scan.track.at(scan.times)[:, 2])
        outward = np.einsum("na,na->n", normals, sight)
        normals = normals * np.where(outward < 0.0, -1.0, 1.0)[:, np.newaxis]
        slants = slants_of(sight, normals)
        qualities = qualities * ramp(np.abs(outward) / np.maximum(ranges, _NOTHING), *_GRAZING)
        qualities = qualities / np.sqrt(per_echo)
        known = qualities > 0.0
        return cls(*(array[known] for array in (scan.times, ranges, bearings, normals, slants, qualities)))


def reaches(times: np.ndarray, bearings: np.ndarray, ranges: np.ndarray) -> np.ndarray:
    """Return how far from each point of a scan (n,) [m] its neighbours on a surface may be.

    times: (n,) s, one per beam. bearings: (n,) rad. ranges: (n,) m. The head's step follows from times and bearings.
    """
    _, first = np.unique(times, return_index=True)
    steps = np.abs(wrapped(np.diff(bearings[first])))
    angle = _REACH_STEPS * np.quantile(steps, _STEP_QUANTILE) if len(steps) else 0.0
    return np.maximum(LEAST_REACH, np.clip(angle, *_REACH_ANGLES) * ranges)


def points_per_echo(times: np.ndarray, ranges: np.ndarray) -> np.ndarray:
    """Return how many points (n,) tell the same as each one: those of its beam at about its range, itself included.

    times: (n,) s, one per beam. ranges: (n,) m.
    """
    order = np.lexsort([ranges, times])
    times, ranges = times[order], ranges[order]
    count = np.ones(len(order))
    for lag in range(1, len(order)):
        share = np.where(times[lag:] == times[:-lag], ramp(ranges[lag:] - ranges[:-lag], *_ECHO_LENGTH), 0.0)
        if not share.any():
            break
        count[lag:] += share
        count[:-lag] += share
    result = np.empty(len(order))
    result[order] = count
    return result


def surface_normals(points: np.ndarray, reach: np.ndarray) -> Tuple[np.ndarray, np.ndarray]:
    """Return unit normals (n, 2) of the lines that points (n, 2) lie on, and how certain these are (n,), 0 to 1.

    reach: (n,) m, within which neighbours count.
    """
    count = min(_NEIGHBOURS + 1, len(points))
    if count < _FEWEST[0]:
        return np.zeros((len(points), 2)), np.zeros(len(points))
    distance, index = cKDTree(points).query(points, k=count)
    reach = np.minimum(reach, distance[:, -1])
    reach = np.maximum(reach, _NOTHING)[:, np.newaxis]
    weight = ramp(distance, reach, _NEAR * reach)
    total = weight.sum(axis=1)
    group = points[index]
    mean = (group * weight[..., np.newaxis]).sum(axis=1) / total[:, np.newaxis]
    offset = group - mean[:, np.newaxis]
    covariance = np.einsum("nk,nka,nkb->nab", weight, offset, offset) / total[:, np.newaxis, np.newaxis]
    values, vectors = np.linalg.eigh(covariance)
    flatness = values[:, 0] / np.maximum(values[:, 1], _NOTHING)
    return vectors[:, :, 0], ramp(total, *_FEWEST) * ramp(flatness, *_FLATNESS)


def ramp(values: np.ndarray, zero: np.ndarray, one: np.ndarray) -> np.ndarray:
    """Return 0 for values (...) at `zero` and beyond, 1 at `one` and beyond, and linearly between."""
    return np.clip((values - zero) / (one - zero), 0.0, 1.0)


def slants_of(sights: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """Return range times sine of incidence (n,) [m] of what is seen along `sights` (n, 2) [m] with `normals` (n, 2)."""
    return np.abs(sights[:, 0] * normals[:, 1] - sights[:, 1] * normals[:, 0])


_COUNTED = 6  # nearest points that are counted, the point included; more are no small thing
_ALONE = (3.4, 2.4)  # points within reach, the point included: from too many for something small to few enough
_EXTENDED = 3.0  # times the reach: so far a wall may go on with single echoes
_BESIDE = (1.0, 2.0)  # m beside the line of a wall: from an echo of the wall to one of something else
_ASKEW = 0.1  # rad by which the line of a wall may be turned
_STRONG = 1.5  # times Otsu's threshold of a scan: from there on an echo that stands alone is no speckle
_MISTAKEN = (3.0, 12.0)  # m: from what is heard together in all scans to how far a vehicle goes in a turn of the head
_OTHERS = (1.0, 0.3)  # echoes of posts within these distances of each, on average: from too many to few enough


def post_points(scan: Scan, sights: Sights, surfaces: SurfacePoints) -> SurfacePoints:
    """Return the strong points of a scan that too few others surround for a line; their normals are the lines of sight.

    surfaces: the points of the scan that lie on surfaces. The last echoes of a wall, where the sonar's range ends, are
    none: they travel with the vehicle.
    """
    sight, ranges, bearings, reach, per_echo = sights
    threshold = max(height_threshold(scan.points[:, 3]), _NOTHING)
    strong = ramp(scan.points[:, 3], threshold, _STRONG * threshold)
    qualities = ramp(_crowds(scan.points[:, :2], reach), *_ALONE) * strong
    candidates = np.flatnonzero((qualities > 0.0) & (ranges > 0.0))
    qualities[candidates] *= 1.0 - _on_surfaces(sight[candidates], reach[candidates], surfaces)
    qualities = qualities * _distinctness(sight, qualities)
    qualities = qualities / np.sqrt(per_echo)
    normals = sight / np.maximum(ranges, _NOTHING)[:, np.newaxis]
    known = (qualities > 0.0) & (ranges > 0.0)
    arrays = (scan.times, ranges, bearings, normals, np.zeros(len(ranges)), qualities)
    return SurfacePoints(*(array[known] for array in arrays))


def _distinctness(places: np.ndarray, qualities: np.ndarray) -> float:
    """Return how much a scan's echoes of posts count, 0 to 1: where many stand together, each may be taken for another.

    places: (n, 2) m. Clutter is dense, and in the fit some of it always meets other clutter.
    """
    posts = np.flatnonzero(qualities > 0.0)
    if not len(posts):
        return 1.0
    distance = np.hypot(*(places[posts, np.newaxis] - places[posts]).transpose(2, 0, 1))
    others = ((distance > _MISTAKEN[0]) & (distance < _MISTAKEN[1])) @ qualities[posts]
    return float(ramp(np.array([others @ qualities[posts] / qualities[posts].sum()]), *_OTHERS)[0])


def _crowds(points: np.ndarray, reach: np.ndarray) -> np.ndarray:
    """Return how many points (n,) there are within `reach` (n,) [m] of each of `points` (n, 2), itself included."""
    count = min(_COUNTED, len(points))
    if not count:
        return np.zeros(0)
    distance, _ = cKDTree(points).query(points, k=np.arange(1, count + 1))
    reach = np.maximum(reach, _NOTHING)[:, np.newaxis]
    return ramp(distance, reach, _NEAR * reach).sum(axis=1)


def _on_surfaces(places: np.ndarray, reach: np.ndarray, surfaces: SurfacePoints) -> np.ndarray:
    """Return how much points at `places` (n, 2) [m] from the sonar lie where surfaces near them go on: (n,), 0 to 1."""
    if not len(places) or not len(surfaces):
        return np.zeros(len(places))
    known = surfaces.ranges[:, np.newaxis] * np.column_stack([np.cos(surfaces.bearings), np.sin(surfaces.bearings)])
    offset = places[:, np.newaxis] - known
    distance = np.hypot(offset[..., 0], offset[..., 1])
    beside = np.abs(np.einsum("nsa,sa->ns", offset, surfaces.normals)) - _ASKEW * distance
    farthest = _EXTENDED * reach[:, np.newaxis]
    near = ramp(distance, farthest, _NEAR * farthest) * ramp(beside, _BESIDE[1], _BESIDE[0])
    return (near * np.minimum(1.0, surfaces.qualities)).max(axis=1)
