"""Echoes that go along with the vehicle, of its own frame, its tether or a boat that follows: found, and left out."""

from dataclasses import replace
from typing import List, Optional, Sequence, Tuple

import numpy as np
from scipy.ndimage import binary_dilation, binary_propagation

from mlsm_manager.scan_matching.scan import Track
from mlsm_manager.self_check.causes import CERTAIN, Cause
from sonar_processing.beams.beam import PlacedBeam, beam_directions

_SECTORS, _CELL = 36, 0.2  # of the circle; m, of the range
_SECTOR = 2.0 * np.pi / _SECTORS
_MOSTLY = 0.8  # share of a sector's beams that hear it at one range, while the vehicle moves and all else does
_STRETCHES = 4  # of the recording: with more gain, echoes of a companion become longer
_ALONG_BEAMS = np.array([[0, 0, 0], [1, 1, 1], [0, 0, 0]])
_NARROWEST = 2  # sectors beside each other
_WIDEST = 2.0 / 3.0  # of those looked at: a ring all around is the floor or the pulse, which echo_extractor removes
_ELSEWHERE = 0.25  # share of the beams of all other sectors: in a tank, walls are as far wherever the vehicle turns
_LONG = 1.2  # m: how far echoes of a wall reach along a beam, an echo's length and a cell
_FEWEST = 6  # times that the head looks into a sector: walls may happen to be as far in fewer
_MOVES = np.array([10.0, np.pi / 2.0])  # m or rad: of a vehicle that goes less all walls may go along
_LEAVES = np.array([5.0, np.pi / 2.0])  # m towards it, or rad: a vehicle that goes or turns less may follow a wall
_END, _AT_ENDS = 0.1, 0.5  # share of its beams, where the vehicle is farthest to a side, and of these that hear it
_LEFT = 0.5  # m: by which what is hidden behind it may matter


def without_companions(beams: Sequence[PlacedBeam], track: Track) -> Tuple[List[PlacedBeam], List[Cause]]:
    """Return the beams without what goes along with the vehicle, which goes by T_odom_base `track`, and the cause."""
    moves = np.ptp(track.poses, axis=0)
    if not beams or (np.array([np.hypot(*moves[:2]), moves[2]]) < _MOVES).all():
        return list(beams), []
    angles = np.array([one.beam.angle for one in beams])
    sectors = ((angles % (2.0 * np.pi)) / (2.0 * np.pi) * _SECTORS).astype(int) % _SECTORS
    loud, looked = _loudness(beams, sectors)
    goes_along = _heard_always(loud.sum(axis=0), looked.sum(axis=0), sectors)
    if goes_along is None:
        return list(beams), []
    pointing = goes_along.any(axis=1)[sectors]
    heard = np.array([goes_along[sector, _loud(one)].any() for one, sector in zip(beams, sectors)])[pointing]
    towards = [one for one, points in zip(beams, pointing) if points]
    if _may_be_wall(goes_along) and not _is_heard_everywhere(track, towards, heard):
        return list(beams), []
    near = binary_dilation(goes_along | _in_next_sectors(goes_along), _ALONG_BEAMS)
    often = _mostly(loud, looked).any(axis=0)
    near = binary_propagation(near, _ALONG_BEAMS, near | binary_dilation(often, _ALONG_BEAMS))
    metres, width = _CELL * (0.5 + np.nonzero(goes_along)[1].min()), goes_along.any(axis=1).sum() * 360 // _SECTORS
    text = f"something {metres:.1f} m away goes along with the vehicle, in {width} deg of the circle"
    left = [_without(one, near[sector]) for one, sector in zip(beams, sectors)]
    return left, [Cause(text, CERTAIN, is_mended=True, metres=_LEFT)]


def _may_be_wall(goes_along: np.ndarray) -> bool:
    """Return whether no arc of the cells (sectors, cells) is wider than a straight wall beside the vehicle makes it."""
    nearest = _CELL * np.arange(goes_along.shape[1])
    widest = 2.0 * np.arccos(nearest / (nearest + _LONG)) + 2.0 * _SECTOR
    return bool((goes_along.sum(axis=0) * _SECTOR <= widest).all())


def _is_heard_everywhere(track: Track, beams: Sequence[PlacedBeam], heard: np.ndarray) -> bool:
    """Return whether the vehicle moves away or turns, and still hears it at both ends of its way and of its turns.

    beams: that point to it. heard: (n,) whether they hear it. A vehicle that follows a wall hears it at one range all
    the way, and no longer where it leaves it.
    """
    angles, poses = np.array([one.beam.angle for one in beams]), np.stack([one.T_target_sonar for one in beams])
    towards = beam_directions(angles, poses)[:, :2].mean(axis=0)
    moves = track.at(np.array([one.beam.stamp_ns for one in beams]) * 1e-9)
    values = np.column_stack([moves[:, :2] @ towards, np.unwrap(moves[:, 2])])
    in_order, few = heard[np.argsort(values, axis=0)], max(int(_END * len(beams)), 1)
    ends = np.array([in_order[:few].mean(axis=0), in_order[-few:].mean(axis=0)])
    return bool((np.ptp(values, axis=0) >= _LEAVES).any() and (ends > _AT_ENDS).all())


def _loudness(beams: Sequence[PlacedBeam], sectors: np.ndarray) -> Tuple[np.ndarray, np.ndarray]:
    """Return how many beams are loud in each cell (stretches, sectors, cells), of how many (stretches, sectors)."""
    loud = np.zeros((_STRETCHES, _SECTORS, 1 + max(int(_cells(one).max()) for one in beams)))
    looked = np.zeros((_STRETCHES, _SECTORS))
    stretches = np.arange(len(beams)) * _STRETCHES // len(beams)
    np.add.at(looked, (stretches, sectors), 1.0)
    for one, stretch, sector in zip(beams, stretches, sectors):
        loud[stretch, sector, _loud(one)] += 1.0
    return loud, looked


def _heard_always(loud: np.ndarray, looked: np.ndarray, sectors: np.ndarray) -> Optional[np.ndarray]:
    """Return in which cells (sectors, cells) most beams are loud; None where that is no companion.

    loud, looked: of all beams; see `_loudness`. sectors: (n,) of each beam.
    """
    entered = np.bincount(sectors[np.diff(sectors, prepend=-1) != 0], minlength=_SECTORS) >= _FEWEST
    always = _mostly(loud, looked) & entered[:, np.newaxis]
    widest = _WIDEST * np.count_nonzero(entered)
    elsewhere = (loud * ~always).sum(axis=0) / np.maximum(looked @ ~always, 1)
    always[:, (always.sum(axis=0) > widest) | (elsewhere > _ELSEWHERE)] = False
    always &= binary_dilation(_in_next_sectors(always), _ALONG_BEAMS)
    return always if _NARROWEST <= always.any(axis=1).sum() <= widest else None


def _mostly(loud: np.ndarray, looked: np.ndarray) -> np.ndarray:
    """Return in which cells (..., sectors, cells) most of the beams that look (..., sectors) are loud."""
    return loud > _MOSTLY * looked[..., np.newaxis]


def _in_next_sectors(cells: np.ndarray) -> np.ndarray:
    """Return which cells (sectors, cells) lie beside some of `cells`, as far away."""
    return np.roll(cells, 1, axis=0) | np.roll(cells, -1, axis=0)


def _loud(placed: PlacedBeam) -> np.ndarray:
    """Return the numbers of the cells that are more than half as loud as the loudest."""
    strengths = placed.beam.intensities
    return np.unique(_cells(placed)[strengths > strengths.max(initial=0) / 2])


def _cells(placed: PlacedBeam) -> np.ndarray:
    bins = np.arange(max(len(placed.beam.intensities), 1))
    return ((bins + 0.5) * placed.beam.range_resolution / _CELL).astype(int)


def _without(placed: PlacedBeam, goes_along: np.ndarray) -> PlacedBeam:
    """Return a beam that is silent in the cells (n,) of a sector."""
    if not goes_along.any() or not len(placed.beam.intensities):
        return placed
    strengths = np.where(goes_along[_cells(placed)], 0, placed.beam.intensities).astype(placed.beam.intensities.dtype)
    return replace(placed, beam=replace(placed.beam, intensities=strengths))
