"""How sure a fit is, as its residuals tell it (a sandwich estimate: White 1980; Liang and Zeger 1986).

What echoes err by depends on pulse, beam, surface and echo extraction, and is not known beforehand: a deviation that
each point is given serves to weigh the points, not to say how far off the fix is. Three things are measured instead,
in the scan at hand:

- noise: the sums of the gradients over clusters of neighbouring points, which err alike. A fit makes the residuals of
  what it leans on too small; each cluster is corrected by its own leverage (Bell and McCaffrey 2002, "CR2"). Where few
  clusters tell of a direction, their estimate is shrunk towards that of the single points, scaled by how much more
  clusters vary than points in all directions; where few points do, theirs is shrunk towards that of all points. It is
  never less than a tenth of the points' deviations, about a centimetre: no map of cells is finer.
- curvature: how the gradient changes over the two standard deviations in which the fit may lie. A point that is moved
  meets another block, so that this is less than the points' information.
- the map: its points were laid by a scan like this one, with the error of that scan's pose, which all of them share.
  Later scans were laid on the first and repeat its error: no number of them takes it away, but the more they are the
  less of it do the residuals show.
"""

from dataclasses import dataclass
from typing import Callable, Tuple

import numpy as np
from scipy.linalg import eigh

from mlsm_manager.scan_matching.scan_path import POSE, STATES

_GREATEST_LEVERAGE = 0.95  # CR2 divides by the root of one minus the leverage, which must not vanish
_LEAST_SCALE = 0.01  # square of a tenth: noise is never less than that of the points' deviations, see above
# A gradient that hardly changes is a matter of few neighbours: it inflates a deviation ten times at most.
_LEAST_CURVATURE = 0.1
# Standard deviations to either side over which the gradient is differenced.
_SPAN = 2.0
_LEAST_SPAN = 0.1
_LEAST_INFORMATION = 1e-6  # share of all information: keeps a matrix invertible where no point tells anything
_TOLD_BY_PRIOR = 0.95  # share of the information: where the prior tells more, the points' curvature is noise
Gradient = Callable[[np.ndarray], np.ndarray]
"""From a state (8,) to the gradient (8,) of all points."""


@dataclass(frozen=True)
class PointEvidence:
    """What the points say at a fit.

    gradient: (n, 8). information: (n, 8, 8). scale_information: (8, 8) what the points say only because something is
    known beforehand of their ranges' common scale. cluster: (n,) int, 0 to k - 1, which points are neighbours. hidden:
    how large the part of the map's error is that the residuals do not show, as a multiple of the noise that they show.
    """

    gradient: np.ndarray
    information: np.ndarray
    scale_information: np.ndarray
    cluster: np.ndarray
    hidden: float

    def summed(self, values: np.ndarray) -> np.ndarray:
        """Return the sums (k, ...) of `values` (n, ...) over the clusters."""
        sums = np.zeros((self.cluster.max() + 1, *values.shape[1:]))
        np.add.at(sums, self.cluster, values)
        return sums


@dataclass(frozen=True)
class _Basis:
    """States in which the points' information and all other are diagonal and add up to the identity.

    vectors: (8, 8), a column each. share: (8,) of the information that is the points'. metric: (8, 8) the sum of all.
    of_prior: (8, 8) the prior's information in this basis.
    """

    vectors: np.ndarray
    share: np.ndarray
    metric: np.ndarray
    of_prior: np.ndarray

    def information(self, inside: np.ndarray) -> np.ndarray:
        """Return an information (8, 8) of this basis in the states' own units."""
        back = self.metric @ self.vectors
        return back @ inside @ back.T


def residual_covariance(
    theta: np.ndarray, points: PointEvidence, gradient: Gradient, prior_information: np.ndarray
) -> np.ndarray:
    """Return the covariance (8, 8) of a fit at `theta` (8,), prior included."""
    information = points.information.sum(axis=0)
    metric = information + points.scale_information + prior_information
    share, vectors = eigh(information, metric)
    basis = _Basis(vectors, np.clip(share, 0.0, 1.0), metric, vectors.T @ prior_information @ vectors)
    noise, scale = _noise(basis, points)
    curvature = _curvature(basis, theta, gradient, np.clip(_SPAN * np.sqrt(scale), _LEAST_SPAN, 1.0))
    gain = np.linalg.inv(curvature)
    of_scan = vectors @ gain @ (noise + np.diag(1.0 - basis.share)) @ gain @ vectors.T
    of_prior = (vectors @ gain @ vectors.T @ prior_information)[:, POSE]
    laid = _map_covariance(basis, curvature, scale * points.hidden)
    # Noise that is measured in few places may seem more than the prior: what was known before a scan is not lost by it.
    of_scan = _bounded(_symmetric(of_scan), np.linalg.inv(prior_information))
    return _symmetric(of_scan + _shared(basis, laid, prior_information, of_prior))


def _noise(basis: _Basis, points: PointEvidence) -> Tuple[np.ndarray, float]:
    """Return the covariance (8, 8) of the gradient, and how many times the points' information it is, on average."""
    gradient = points.gradient @ basis.vectors
    leverage = basis.vectors.T @ points.information @ basis.vectors
    single = gradient + np.einsum("nab,nb->na", leverage, gradient) / 2.0
    single_scale = max(_mean_scale(basis, single), _LEAST_SCALE)
    of_points = _shrunk(single_scale * np.diag(basis.share), single, leverage)
    leverage = points.summed(leverage)
    values, vectors = np.linalg.eigh(leverage)
    stretch = (1.0 - np.clip(values, 0.0, _GREATEST_LEVERAGE)) ** -0.5
    sums = np.einsum("kab,kb,kcb,kc->ka", vectors, stretch, vectors, points.summed(gradient), optimize=True)
    scale = max(_mean_scale(basis, sums), single_scale)
    return _shrunk(of_points * scale / single_scale, sums, leverage), scale


def _mean_scale(basis: _Basis, gradients: np.ndarray) -> float:
    return float((gradients**2).sum() / max(basis.share.sum(), 1e-9))


def _shrunk(expected: np.ndarray, gradients: np.ndarray, leverage: np.ndarray) -> np.ndarray:
    """Return (8, 8) what the `gradients` (k, 8) vary by, shrunk towards what is `expected` (8, 8) where few tell.

    leverage: (k, 8, 8). As many of them as there are states count half.
    """
    each = np.einsum("kaa->ka", leverage)
    effective = each.sum(axis=0) ** 2 / np.maximum((each**2).sum(axis=0), 1e-12)
    known = effective / (effective + STATES)
    measured = np.sqrt(np.outer(known, known)) * (gradients.T @ gradients)
    return measured + np.sqrt(np.outer(1.0 - known, 1.0 - known)) * expected


def _curvature(basis: _Basis, theta: np.ndarray, gradient: Gradient, span: float) -> np.ndarray:
    """Return the derivative (8, 8) of the whole gradient, as differences over `span` to either side.

    It is 1 where the residuals are linear, and in directions of which the prior tells nearly all.
    """
    result = np.eye(STATES)
    for column in np.flatnonzero(basis.share > 1.0 - _TOLD_BY_PRIOR):
        step = span * basis.vectors[:, column]
        change = basis.vectors.T @ (gradient(theta + step) - gradient(theta - step)) / (2.0 * span)
        result[:, column] = change + basis.of_prior[:, column]
    values, vectors = np.linalg.eigh(_symmetric(result))
    return (vectors * np.clip(values, _LEAST_CURVATURE, 1.0)) @ vectors.T


def _map_covariance(basis: _Basis, curvature: np.ndarray, scale: float) -> np.ndarray:
    """Return (3, 3): the covariance of the pose of a scan like this one, its motion known, for `scale` of its noise."""
    of_points = basis.information(np.eye(STATES) - basis.of_prior)[POSE, POSE]
    # What no point tells stays as good as unknown.
    pose_information = of_points + _LEAST_INFORMATION * basis.metric[POSE, POSE]
    share, vectors = eigh(basis.information(curvature - basis.of_prior)[POSE, POSE], pose_information)
    return scale * (vectors * np.clip(share, _LEAST_CURVATURE, 1.0) ** -2) @ vectors.T


def _shared(basis: _Basis, laid: np.ndarray, prior_information: np.ndarray, of_prior: np.ndarray) -> np.ndarray:
    """Return (8, 8) what the map's error adds, given that the prior comes from fixes in the same map.

    laid: (3, 3) covariance of that error; the prior shares no more of it than it has. of_prior: (8, 3) derivative of
    the fit by the prior's pose. Of an error that both share, weighing them against each other takes nothing away.
    """
    shared = _bounded(laid, np.linalg.inv(prior_information)[POSE, POSE])
    whole = np.zeros((STATES, STATES))
    whole[POSE, POSE] = shared
    inside = basis.vectors.T @ basis.metric @ (whole - of_prior @ shared @ of_prior.T) @ basis.metric @ basis.vectors
    values, vectors = np.linalg.eigh(_symmetric(inside))
    turned = basis.vectors @ vectors
    return (turned * np.maximum(values, 0.0)) @ turned.T


def _bounded(covariance: np.ndarray, bound: np.ndarray) -> np.ndarray:
    """Return the covariance (n, n), in each direction no more than `bound` (n, n)."""
    ratio, vectors = eigh(covariance, bound)
    back = bound @ vectors
    return (back * np.minimum(ratio, 1.0)) @ back.T


def _symmetric(matrix: np.ndarray) -> np.ndarray:
    return (matrix + matrix.T) / 2.0
