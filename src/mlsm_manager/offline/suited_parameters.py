"""What a recording tells of its echoes and its odometry, and the parameters that suit them."""

from collections import Counter
from enum import Enum
from typing import Collection, NamedTuple, Optional, Sequence

import numpy as np

from mlsm_manager.joint_solver.live_solver import LiveSolver
from mlsm_manager.joint_solver.map_support import shares_heard_before
from mlsm_manager.localisation.odometry_profiles import OdometryKind, profile_values
from mlsm_manager.offline.replay_parameters import ReplayParameters
from mlsm_manager.scan_matching.scan import Track
from mlsm_manager.self_check.map_checks import scans_go_on
from sonar_processing.beams.beam import Beam
from sonar_processing.filters.echo_extractor import ExtractionMode

_BINARY = 0.9  # share of non-zero strengths that equal the strongest
_AT_ONCE = 1000  # beams that are counted together: bounds the memory


class EchoShape(Enum):
    """What an echo looks like along a beam.

    PEAK: strengths differ; an echo has a peak, and noise has no sharp edge. PLATEAU: strengths only say "something" or
    "nothing"; an echo is metres long, its middle means nothing, and the surface is where it begins.
    """

    PEAK = "PEAK"
    PLATEAU = "PLATEAU"


_SUITED = {
    # Weak echoes count: what they are compared with tells them from speckle.
    EchoShape.PEAK: {
        "mode": ExtractionMode.MATCHED_FILTER,
        "match_resolution": 0.5,
        "threshold_share": 0.5,
        "min_height": 2.0,
    },
    # Plateaus lengthen with range, and the middle of their points moves outwards with them: by some percent of range.
    EchoShape.PLATEAU: {
        "mode": ExtractionMode.DENSE,
        "spacing": 1.0,
        "match_resolution": 1.0,
        "range_scale_deviation": 0.05,
    },
}


def echo_shape_of(beams: Sequence[Beam]) -> EchoShape:
    """Return PLATEAU where nearly all echoes are as strong as any, else PEAK."""
    counts = np.zeros(256, dtype=np.int64)
    for start in range(0, len(beams), _AT_ONCE):
        strengths = np.concatenate([beam.intensities for beam in beams[start : start + _AT_ONCE]])
        counts += np.bincount(strengths, minlength=256)
    counts = counts[1:]
    if not counts.any():
        return EchoShape.PEAK
    strongest = counts[np.flatnonzero(counts)[-1]]
    return EchoShape.PLATEAU if strongest >= _BINARY * counts.sum() else EchoShape.PEAK


def suited(
    parameters: ReplayParameters, shape: EchoShape, fixed: Collection[str], sigma: Optional[float] = None
) -> ReplayParameters:
    """Return `parameters` with those that suit the shape of the echoes, but for those that are `fixed`.

    sigma: m, standard deviation of an echo along range, of peaks.
    """
    values = dict(_SUITED[shape])
    if shape is EchoShape.PEAK and sigma is not None:
        values["pulse_sigma"] = round(sigma, 3)
    return parameters.changed({name: value for name, value in values.items() if name not in fixed})


_MOST_BEAMS = 2000  # about ten turns of a head, spread over the recording
_QUANTILE = 0.4  # over the beams: what is heard in most directions at a range is no echo
_LEVEL = 0.75  # of the autocorrelation: high on its flank, where slanting walls lengthen the echoes least
_RANGE = (0.15, 2.0)  # m: a pulse of 0.2 ms, and a wall that a wide beam meets aslant
_FEWEST_BINS = 4


def echo_sigma(beams: Sequence[Beam]) -> float:
    """Return the standard deviation [m] of an echo along range, between 0.15 and 2 m.

    The autocorrelation of a Gaussian echo of deviation s falls to `_LEVEL` at a shift of 2 s sqrt(-log(_LEVEL)). Its
    value at shift 0 is taken from shifts 1 and 2, because what differs from bin to bin at random counts there only.
    """
    (bins, resolution), _ = Counter((beam.intensities.size, beam.range_resolution) for beam in beams).most_common(1)[0]
    alike = [beam.intensities for beam in beams if (beam.intensities.size, beam.range_resolution) == (bins, resolution)]
    if bins < _FEWEST_BINS:
        return _RANGE[0]
    correlation = _autocorrelation(np.stack(alike[:: -(-len(alike) // _MOST_BEAMS)]).astype(np.float32))
    if not correlation[1] > 0.0:
        return _RANGE[0]
    top = (4.0 * correlation[1] - correlation[2]) / 3.0
    shift = resolution * _falls_below(correlation, _LEVEL * top)
    return float(np.clip(shift / (2.0 * np.sqrt(-np.log(_LEVEL))), *_RANGE))


def _autocorrelation(strengths: np.ndarray) -> np.ndarray:
    """Return (bins,) the autocorrelation along range of what stands out of the ring, summed over the beams."""
    heights = np.maximum(strengths - np.quantile(strengths, _QUANTILE, axis=0), 0.0)
    bins = heights.shape[1]
    spectrum = np.fft.rfft(heights, 2 * bins, axis=1)
    return np.fft.irfft((np.abs(spectrum) ** 2).mean(axis=0))[:bins]


def _falls_below(values: np.ndarray, level: float) -> float:
    """Return the place, linearly between the bins, at which values (n,) first fall below a level from bin 1 on."""
    below = np.flatnonzero(values[1:] < level)
    if not len(below):
        return float(len(values))
    after = int(below[0]) + 1
    before = after - 1
    share = (values[before] - level) / (values[before] - values[after])
    return before + float(np.clip(share, 0.0, 1.0))


_STANDS = 0.05  # m: a position that moves by less never changed, but for rounding and lever arms of a tilting base
_TURNS = 0.02  # rad: a compass at rest says less, a vehicle that travels turns more
_WORTH_TRYING = 0.75
"""Share of scans that go on, below which a second mapping is worth its time. Simulated tours ahead have 0.85 and more,
strafing ones 0.57 and 0.66."""


class OdometryFound(NamedTuple):
    """kind: of the odometry. reason: one line that says why."""

    kind: OdometryKind
    reason: str


def odometry_of(track: Track) -> OdometryFound:
    """Return what a recording's T_odom_base tells of the vehicle's motion."""
    extent = np.ptp(track.poses[:, :2], axis=0).max()
    turned = np.ptp(track.poses[:, 2])
    if extent > _STANDS:
        reason = f"positions change by up to {extent:.1f} m; say --odometry thrusters if no DVL measured them"
        return OdometryFound(OdometryKind.DVL, reason)
    if turned > _TURNS:
        degrees = np.degrees(turned)
        return OdometryFound(OdometryKind.HEADING, f"the position never changes, the heading by {degrees:.0f} degrees")
    reason = "neither position nor heading changes, so the vehicle stands still; if it moved, say --unknown-motion"
    return OdometryFound(OdometryKind.DVL, reason)


def with_odometry(parameters: ReplayParameters, kind: OdometryKind, fixed: Collection[str]) -> ReplayParameters:
    """Return `parameters` with the profile of an odometry, but for those that are `fixed`."""
    return parameters.changed({key: value for key, value in profile_values(kind).items() if key not in fixed})


def may_strafe(ahead: Optional[LiveSolver]) -> bool:
    """Return whether scans do not go on in the run of a solver that expects the vehicle to go ahead."""
    if ahead is None:
        return False
    shares = shares_heard_before(ahead.solution, 0)
    return scans_go_on(ahead.log.node_times[1:], shares, _WORTH_TRYING).fires
