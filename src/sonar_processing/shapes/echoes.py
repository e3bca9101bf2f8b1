"""The echoes of a scan, who saw them, and which of them belong to a wall."""

import itertools
from dataclasses import dataclass, replace

import numpy as np

from node_support.geometry import bearings_of
from sonar_processing.cloud import Cloud

_SAME_POINT = 1e-6
_NEIGHBOURS = 4  # Echoes looked at on each side: some hold noise or another surface in front of the wall
# Beams from an echo to the next one of its wall: one that heard nothing, or two where the head is slow, lie between.
_REACH = 2.5
# A wall goes on beyond two of its echoes by this share of their distance; farther out their noise would aim it.
_CONTINUED = 1.5
# Sine of the angle between beam and wall above which two echoes make a line. Flatter lines lead from a thing to
# something far behind it, so that two echoes are in line by chance; then _FLAT_SUPPORT echoes have to lie on it.
_SQUARE, _FLATTEST, _FLAT_SUPPORT = 0.5, 0.05, 4
# A wall goes on in the next beam, so many times as far away as the beams are apart, where it is not seen too flat.
_NEXT_BEAM = 1.4
# Echoes of a wall's neighbouring beams are alike; a lone thing's neighbours hold noise, of fewer bins than this share.
_ALIKE = 0.5
# Two echoes of a thing lie across the beams; of a wall that the beams meet obliquely, the one is so much farther away
# than the other, as a share of their distance across.
_OBLIQUE = 0.7
_SCATTERED = 2.0  # Bins of speckle are farther apart than those of the usual echo, by this factor at least


@dataclass(frozen=True)
class BeamEchoes:
    """The echoes of one scan, seen from above.

    points: (m, 2) float64, x y [m]: the middle of each echo, weighted by strength.
    weights: (m,) number of cloud points in each. lengths: (m,) from the nearest point of each to the farthest, m.
    members: (k,) indices of the finite points of the cloud; owner: (k,) the echo that each of them belongs to.
    time_stamps: (m,) float64, when each echo's beam was taken, s, without the sign that tells still from moving.
    """

    points: np.ndarray
    weights: np.ndarray
    lengths: np.ndarray
    members: np.ndarray
    owner: np.ndarray
    time_stamps: np.ndarray

    def __len__(self) -> int:
        return len(self.points)

    def strong(self, share: float) -> np.ndarray:
        """Return the indices (k,) of the echoes with at least `share` times as many points as the usual one.

        Half of all points belong to echoes as large as the usual one or larger: noise, many echoes of one bin each,
        does not change it.
        """
        if not len(self):
            return np.arange(0)
        sizes = np.sort(self.weights)
        usual = sizes[np.searchsorted(np.cumsum(sizes), sizes.sum() / 2.0)]
        return np.flatnonzero(self.weights >= share * usual)


def beam_echoes(cloud: Cloud, gap: float) -> BeamEchoes:
    """Return the echoes of a cloud whose points come beam by beam and with growing range, as all stages keep them.

    Neighbours of one beam that are at most `gap` [m] apart belong together; with 0 every point is an echo of its own.
    A pulse fills many bins, and a wide beam smears an inclined surface over more: the surface is near the middle of
    them, not at the nearest one, and a beam that hits squarely must not outvote those that graze.
    """
    members = np.flatnonzero(cloud.valid)
    points = cloud.points[members].astype(np.float64)
    stamps = np.abs(cloud.time_stamps[members])
    begins = np.ones(len(points), dtype=bool)
    begins[1:] = (np.diff(stamps) != 0.0) | (np.linalg.norm(np.diff(points[:, :3], axis=0), axis=1) > gap)
    starts = np.flatnonzero(begins)
    owner = np.cumsum(begins) - 1
    strengths = np.maximum(points[:, 3], _SAME_POINT)[:, np.newaxis]
    weighted = np.hstack([points[:, :2] * strengths, strengths])
    sums = np.add.reduceat(weighted, starts, axis=0) if len(starts) else weighted
    weights = np.bincount(owner, minlength=len(starts))
    lengths = np.linalg.norm(points[starts + weights - 1, :3] - points[starts, :3], axis=1)
    return BeamEchoes(sums[:, :2] / sums[:, 2:], weights, lengths, members, owner, stamps[starts])


@dataclass(frozen=True)
class Sightings:
    """Echoes in the order of their beams.

    points: (n, 2) x y [m]. origins: (n, 2) where the sonar was. beams: (n,) number of the beam, growing; a beam without
    echoes has a number too. weights: (n,) number of cloud points in each echo.
    lengths: (n,) of each echo along its beam, m.
    step: usual angle from beam to beam, rad, in the cloud's frame: a vehicle that turns with its head widens it.
    """

    points: np.ndarray
    origins: np.ndarray
    beams: np.ndarray
    weights: np.ndarray
    lengths: np.ndarray
    step: float

    @property
    def ranges(self) -> np.ndarray:
        """(n,) distance from the sonar, m."""
        return np.linalg.norm(self.points - self.origins, axis=1)

    @property
    def towards(self) -> np.ndarray:
        """(n, 2) unit vectors from the sonar."""
        return (self.points - self.origins) / np.maximum(self.ranges, 1e-9)[:, np.newaxis]

    def only(self, chosen: np.ndarray) -> "Sightings":
        """Return the echoes at indices `chosen` (k,)."""
        parts = {name: getattr(self, name)[chosen] for name in ("points", "origins", "beams", "weights", "lengths")}
        return replace(self, **parts)


def sightings(echoes: BeamEchoes, chosen: np.ndarray, origins: np.ndarray) -> Sightings:
    """Return the echoes at indices `chosen` (n,), seen from origins (n, 2) x y [m]."""
    points = echoes.points[chosen]
    taken, first, inverse = np.unique(echoes.time_stamps[chosen], return_index=True, return_inverse=True)
    numbers = _beam_numbers(taken)
    axes = (points - origins)[first]
    steps = np.abs(np.diff(np.unwrap(bearings_of(axes)))) / np.diff(numbers)
    steps = steps[steps > 0.0]
    step = float(np.median(steps)) if len(steps) else 0.0
    return Sightings(points, origins, numbers[inverse], echoes.weights[chosen], echoes.lengths[chosen], step)


def _beam_numbers(taken: np.ndarray) -> np.ndarray:
    """Return (b,) numbers of beams taken at growing times (b,) [s]; long intervals hold beams that heard nothing."""
    intervals = np.diff(taken)
    if not len(intervals):
        return np.zeros(len(taken), dtype=int)
    counts = np.maximum(np.rint(intervals / np.median(intervals)).astype(int), 1)
    return np.append(0, np.cumsum(counts))


def wall_echoes(seen: Sightings, thing: float, tolerance: float) -> np.ndarray:
    """Return (n,) bool: the echoes within `tolerance` [m] of a line through echoes of neighbouring beams.

    Those neighbours are farther away than `thing` [m], the width of the widest thing that is no wall. Neighbours are
    told by the beams' order: a turning vehicle sees the same wall twice in a scan, and the odometry's error puts it
    in two places, so that what lies beside an echo need not be its neighbour.
    """
    found = np.zeros(len(seen.points), dtype=bool)
    if len(found) < 3 or seen.step <= 0.0:
        return found
    neighbours = _neighbours(seen, thing)
    for one, other in itertools.combinations(range(len(neighbours)), 2):
        found |= _in_line(seen, neighbours, one, other, thing, tolerance)
    return found


def _neighbours(seen: Sightings, thing: float) -> np.ndarray:
    """Return (2 k, n, 2): of each echo the k nearest of earlier beams and the k nearest of later ones, NaN for none."""
    reach = (thing / np.maximum(seen.ranges, thing) / seen.step + _REACH)[:, np.newaxis]
    later = seen.beams[np.newaxis] - seen.beams[:, np.newaxis]
    apart = np.linalg.norm(seen.points[np.newaxis] - seen.points[:, np.newaxis], axis=2)
    near = (np.abs(later) <= reach) & (apart > thing)
    return np.concatenate(
        [_nearest(seen.points, np.where(near & side, apart, np.inf)) for side in (later < 0, later > 0)]
    )


def _nearest(points: np.ndarray, distances: np.ndarray) -> np.ndarray:
    count = min(_NEIGHBOURS, len(points))
    nearest = np.argpartition(distances, count - 1, axis=1)[:, :count]
    there = np.isfinite(np.take_along_axis(distances, nearest, axis=1))
    return np.where(there[..., np.newaxis], points[nearest], np.nan).transpose(1, 0, 2)


def _in_line(
    seen: Sightings, neighbours: np.ndarray, one: int, other: int, thing: float, tolerance: float
) -> np.ndarray:
    """Return (n,) bool: the echoes in line with two of their neighbours."""
    start, along = neighbours[one], neighbours[other] - neighbours[one]
    length = np.linalg.norm(along, axis=1)
    with np.errstate(invalid="ignore", divide="ignore"):
        along = along / length[:, np.newaxis]
        share = np.einsum("ij,ij->i", seen.points - start, along) / length
        is_between = (share > 0.0) & (share < 1.0)
        is_continued = (share > -_CONTINUED) & (share < 1.0 + _CONTINUED) & (length > thing)
        support = np.count_nonzero(_across(neighbours - start, along) <= tolerance, axis=0)
        sine = _across(seen.towards, along)
        square = is_between & (sine >= _SQUARE)
        flat = (is_between | is_continued) & (sine >= _FLATTEST) & (support >= _FLAT_SUPPORT)
        return (square | flat) & (_across(seen.points - start, along) <= tolerance)


def _across(offsets: np.ndarray, along: np.ndarray) -> np.ndarray:
    return np.abs(offsets[..., 0] * along[..., 1] - offsets[..., 1] * along[..., 0])


def is_alone(group: Sightings, strong: Sightings, weak: Sightings, clearance: float) -> bool:
    """Return whether no other echo belongs to the surface that a group of echoes shows.

    `strong` are the other echoes that are no noise: each has to be `clearance` [m] away from the group. `weak` are the
    rest, of few bins: a surface that is heard faintly goes on in them, so that none as strong as half the group's
    strongest may stand where the next beam would meet it.
    """
    next_beam = _NEXT_BEAM * group.step * float(group.ranges.mean())
    alike = weak.points[weak.weights >= _ALIKE * group.weights.max()]
    return _distance(group.points, strong.points) >= max(clearance, next_beam) and (
        _distance(group.points, alike) >= next_beam
    )


def is_oblique(group: Sightings) -> bool:
    """Return whether a group is two echoes of neighbouring beams that lie nearly in line with the beams."""
    if len(group.points) != 2:
        return False
    outward = group.towards.mean(axis=0)
    offset = group.points[1] - group.points[0]
    across, along = abs(offset @ np.array([-outward[1], outward[0]])), abs(offset @ outward)
    return bool(across > 0.5 * group.step * group.ranges.mean() and along > _OBLIQUE * across)


def is_scattered(group: Sightings, usual: Sightings) -> bool:
    """Return whether the bins of a group's echoes are much farther apart than those of the usual echoes of a scan."""
    steps, usual_steps = group.weights.sum() - len(group.weights), usual.weights - 1
    several = usual_steps > 0
    if not several.any() or not steps:
        return False
    return bool(group.lengths.sum() / steps > _SCATTERED * np.median(usual.lengths[several] / usual_steps[several]))


def footprint(group: Sightings, beam_width: float) -> float:
    """Return the width [m] that two neighbouring beams cover together where a group of echoes stands."""
    return (group.step + beam_width) * float(group.ranges.mean())


def _distance(ones: np.ndarray, others: np.ndarray) -> float:
    """Return the least distance between points (n, 2) and (m, 2), infinite where there are none."""
    if not len(others):
        return float("inf")
    return float(np.linalg.norm(ones[:, np.newaxis] - others[np.newaxis], axis=2).min())
