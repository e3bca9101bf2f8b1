"""Corrects a scan for late stamps, for a wrong speed of sound, and for beams that hear surfaces beside their axis."""

from dataclasses import dataclass, replace
from typing import Tuple

import numpy as np
from scipy.spatial import cKDTree

from mlsm_manager.matching.problem.scan import Scan
from node_support.geometry.planar import inverse, rotated, transformed
from node_support.parameters import ParameterSet, parameter
from sonar_processing.beams.beam_correction import BeamCorrection

# Echoes that make the line of a surface.
_NEIGHBOURS = 10
# m: how far they may lie from each other, or this share of their range where that is more.
_REACH = 4.0
_REACH_OF_RANGE = 0.2
# Two more than any line needs.
_FEWEST = 5
# Variance across the line over that along it: a corner has 1, a rough wall 0.1.
_FLATNESS = 0.3
# The second takes the normals of points that were turned already.
_PASSES = 2
# m: an error of a tenth of the half width then stays below the noise of a range.
_MOST_SHIFT = 0.8


@dataclass(frozen=True)
class BeamEdge(ParameterSet):
    """Half of the width within which a beam hears surfaces."""

    edge_half_width: float = parameter(
        0.0, "angle from the beam's axis to the edge that hears a surface first; 0: points lie on the axis",
        unit="rad", low=0.0, high=0.25, tunable=False,
    )  # fmt: skip


@dataclass(frozen=True)
class SensorModel(BeamEdge, BeamCorrection):
    """How the echoes of a scan lie against the surfaces that made them."""

    def applied(self, scan: Scan) -> Scan:
        """Return the scan `restamped`, `rescaled` and `without_doubtful_points`."""
        timed = rescaled(restamped(scan, self.sonar_delay), self.range_scale)
        return without_doubtful_points(timed, self.edge_half_width)


def restamped(scan: Scan, delay: float) -> Scan:
    """Return the scan as if its beams had been taken `delay` seconds later.

    What each beam heard stays where it was as seen from base_link. The track must cover the later times.
    """
    if delay == 0.0:
        return scan
    seen = transformed(inverse(scan.track.at(scan.times)), scan.points)
    times = scan.times + delay
    points = transformed(scan.track.at(times), seen)
    return replace(scan, points=points, times=times, reference_time=scan.reference_time + delay)


def rescaled(scan: Scan, scale: float) -> Scan:
    """Return the scan with each point `scale` times as far from the vehicle in the plane."""
    if scale == 1.0:
        return scan
    points = scan.points.copy()
    origin = scan.track.at(scan.times)[:, :2]
    points[:, :2] = origin + scale * (points[:, :2] - origin)
    return replace(scan, points=points)


def at_beam_edge(scan: Scan, half_width: float) -> Scan:
    """Return the scan with each point turned about the vehicle, by up to `half_width`, towards its surface's normal.

    A wide beam that meets a surface aslant hears first what its nearer edge meets, and the point was placed on its
    axis: too near by range * tan(incidence) * half_width. Points whose surface is not known stay.
    """
    return _turned(scan, half_width)[0]


def without_doubtful_points(scan: Scan, half_width: float) -> Scan:
    """Return what `at_beam_edge` does, without the points whose place stays doubtful.

    Where within its beam a lone echo lies is not known; and a shift of nearly a metre depends too much on the half
    width, which is not quite the same for strong and for weak echoes.
    """
    turned, incidence, known = _turned(scan, half_width)
    places = scan.track.at(scan.times)
    shift = half_width * np.hypot(*(scan.points[:, :2] - places[:, :2]).T) * np.abs(np.sin(incidence))
    keep = (shift < _MOST_SHIFT) & (known | (half_width == 0.0))
    return replace(turned, points=turned.points[keep], times=scan.times[keep], moving=scan.moving[keep])


def _turned(scan: Scan, half_width: float) -> Tuple[Scan, np.ndarray, np.ndarray]:
    """Return the turned scan, the incidence (n,) rad, and (n,) where it is known."""
    incidence, known = np.zeros(len(scan)), np.zeros(len(scan), dtype=bool)
    if half_width == 0.0 or len(scan) < _FEWEST:
        return scan, incidence, known
    places = scan.track.at(scan.times)
    seen = transformed(inverse(places), scan.points)
    turned = scan.points
    for _ in range(_PASSES):
        incidence, known = _incidence(turned[:, :2], places)
        arms = rotated(seen[:, :2], np.clip(incidence, -half_width, half_width))
        turned = transformed(places, np.column_stack([arms, seen[:, 2:]]))
    return replace(scan, points=turned), incidence, known


def _incidence(points: np.ndarray, places: np.ndarray) -> Tuple[np.ndarray, np.ndarray]:
    """Return (n,) rad from the line of sight to the outward normal of the surface at each point, and where it is known.

    It is 0 where it is not.
    """
    sight = points - places[:, :2]
    # Beams fan out: at a far wall met aslant, the next echo lies many metres on.
    reach = np.maximum(_REACH, _REACH_OF_RANGE * np.hypot(*sight.T))
    normals, known = surface_normals(points, reach)
    outward = normals * np.where(np.einsum("na,na->n", normals, sight) < 0.0, -1.0, 1.0)[:, np.newaxis]
    cross = sight[:, 0] * outward[:, 1] - sight[:, 1] * outward[:, 0]
    return np.where(known, np.arctan2(cross, np.einsum("na,na->n", sight, outward)), 0.0), known


def surface_normals(points: np.ndarray, reach: np.ndarray) -> Tuple[np.ndarray, np.ndarray]:
    """Return unit normals (n, 2) of the lines that points (n, 2) lie on, and (n,) where they do lie on one.

    reach: (n,) m, how far from each point its neighbours may lie.
    """
    distance, index = cKDTree(points).query(points, k=min(_NEIGHBOURS, len(points)))
    distance, index = distance.reshape(len(points), -1), index.reshape(len(points), -1)
    near = distance <= reach[:, np.newaxis]
    count = near.sum(axis=1)
    group = points[np.where(near, index, 0)]
    mean = (group * near[..., np.newaxis]).sum(axis=1) / count[:, np.newaxis]
    offset = (group - mean[:, np.newaxis]) * near[..., np.newaxis]
    covariance = np.einsum("nka,nkb->nab", offset, offset) / count[:, np.newaxis, np.newaxis]
    values, vectors = np.linalg.eigh(covariance)
    return vectors[:, :, 0], (count >= _FEWEST) & (values[:, 0] < _FLATNESS * values[:, 1])
