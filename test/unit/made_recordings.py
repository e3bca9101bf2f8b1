"""A small recording: a vehicle tours an angular basin, without a simulator."""

from typing import Callable, List, Optional, Sequence, Tuple

import numpy as np

from mlsm_manager.localisation.following import Following
from mlsm_manager.localisation.parameters import LocaliserParameters
from mlsm_manager.offline.recording import Recording, scans_of
from mlsm_manager.scan_matching.scan import Scan, Track
from node_support.geometry import matrices
from sonar_processing.beams.beam import Beam, PlacedBeam
from sonar_processing.filters.echo_extractor import EchoExtractor, EchoExtractorParameters

SECONDS = 300.0
_START = 1000.0
HARBOUR = np.array(
    [[-25.0, -18.0], [20.0, -18.0], [20.0, -6.0], [30.0, -6.0], [30.0, 20.0], [4.0, 20.0], [4.0, 14.0], [-25.0, 14.0]]
)  # m
_BINS, _RESOLUTION = 200, 0.3
_BEAM, _STEP = 0.1, np.radians(3.6)


def touring() -> Recording:
    """Return 300 s of a vehicle that goes ahead on an ellipse, with a beam and a pose each tenth."""
    return _along(lambda angle: (12.0 * np.cos(angle) - 2.0, 8.0 * np.sin(angle)))


def wandering() -> Recording:
    """Return as much of a vehicle on a way that does not repeat itself."""
    return _along(lambda angle: (12.0 * np.cos(0.9 * angle) - 2.0, 8.0 * np.sin(1.7 * angle + 0.1 * angle**2)))


def strafing() -> Recording:
    """Return as much of a vehicle on the ellipse that looks up to 86 degrees aside of where it goes."""
    return _along(lambda angle: (12.0 * np.cos(angle) - 2.0, 8.0 * np.sin(angle)), lambda angle: 1.5 * np.sin(angle))


def scans_in(recording: Recording, parameters: Optional[EchoExtractorParameters] = None) -> List[Scan]:
    """Return the scans of echoes that a recording holds."""
    return [scan for scan, _ in scans_of(recording, EchoExtractor(parameters or EchoExtractorParameters()))]


def looked_at(
    recording: Recording, scans: Sequence[Scan], parameters: Optional[LocaliserParameters] = None
) -> Following:  # fmt: skip
    """Return what is known of a vehicle while it goes on, once scans of it were taken and looked at for causes."""
    localiser = (parameters or LocaliserParameters()).build_localiser(recording.sonar_in_base)
    for scan in scans:
        localiser.take_scan(scan)
    localiser.look_for_causes()
    return localiser.following


def trembling(recording: Recording) -> np.ndarray:
    """Return noise [rad] of each heading of a recording, as of one that is measured."""
    return 0.01 * np.random.RandomState(1).normal(size=len(recording.track.times))


def _along(
    way: Callable[[np.ndarray], Tuple[np.ndarray, np.ndarray]],
    aside: Callable[[np.ndarray], np.ndarray] = np.zeros_like,
) -> Recording:
    """Return a recording of a vehicle that is at way(angle), x and y [m], while the angle [rad] grows to 4 pi.

    aside: by how much [rad] it looks to the left of where it goes.
    """
    times = _START + np.arange(0.0, SECONDS + 0.05, 0.1)
    angles = 4.0 * np.pi * (times - _START) / SECONDS
    x, y = way(angles)
    yaw = np.unwrap(np.arctan2(np.gradient(y), np.gradient(x))) + aside(angles)
    track = Track(times, np.column_stack([x, y, yaw]))
    stamps = np.arange(_START + 1.0, _START + SECONDS - 1.0, _BEAM)
    poses, heads = track.at(stamps), _STEP * np.arange(len(stamps))
    ranges = ranges_along(poses[:, :2], poses[:, 2] + heads)
    places = matrices(poses)
    beams = [
        PlacedBeam(Beam(round(1e9 * stamp), "sonar", head, _strengths(distance), _RESOLUTION), place, True)
        for stamp, head, distance, place in zip(stamps, heads, ranges, places)
    ]
    return Recording(beams, 0, track, None)


def ranges_along(places: np.ndarray, angles: np.ndarray, corners: np.ndarray = HARBOUR) -> np.ndarray:
    """Return how far (n,) [m] the walls between `corners` (k, 2) are from `places` (n, 2) along `angles` (n,) [rad]."""
    rays = np.column_stack([np.cos(angles), np.sin(angles)])[:, np.newaxis]
    along = np.roll(corners, -1, axis=0) - corners
    to_corner = corners - places[:, np.newaxis]
    cross = rays[..., 0] * along[:, 1] - rays[..., 1] * along[:, 0]
    with np.errstate(divide="ignore"):
        ranges = (to_corner[..., 0] * along[:, 1] - to_corner[..., 1] * along[:, 0]) / cross
        share = (to_corner[..., 0] * rays[..., 1] - to_corner[..., 1] * rays[..., 0]) / cross
    return np.where((ranges > 0.0) & (share >= 0.0) & (share <= 1.0), ranges, np.inf).min(axis=1)


def _strengths(distance: float) -> np.ndarray:
    """Return strengths (bins,) of an echo at a distance [m]."""
    strengths = np.zeros(_BINS, dtype=np.uint8)
    place = min(int(distance / _RESOLUTION), _BINS - 3)
    strengths[place : place + 3] = 100
    return strengths
