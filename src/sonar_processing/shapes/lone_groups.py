"""Which groups of echoes are things of their own, and not the piece of a wall that happens to be heard."""

import numpy as np

from sonar_processing.shapes.sightings import Sightings

# A wall goes on in the next beam, so many times as far away as the beams are apart, where it is not seen too flat.
_NEXT_BEAM = 1.4
# Echoes of a wall's neighbouring beams are alike; a lone thing's neighbours hold noise, of fewer bins than this share.
_ALIKE = 0.5
# Two echoes of a thing lie across the beams; of a wall that the beams meet obliquely, the one is so much farther away
# than the other, as a share of their distance across.
_OBLIQUE = 0.7
# Bins of speckle are farther apart than those of the usual echo, by this factor at least.
_SCATTERED = 2.0


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
