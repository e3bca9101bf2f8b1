"""What is told while a vehicle goes on in whose recording something is broken: is a position ever called good?

Each row: the recording and the fault; distance [m] of the live positions from those of the unbroken recording, in the
mean and at most; "told": median of the stated deviation [m]; "covered": share of the positions within 2.5 of it;
"good": share that is called good though it is farther off; the cause that is named first once all was seen, and after
how many seconds from the beginning of the fault, or of the run, anything was named.
"""

from functools import lru_cache
from typing import Iterator, List, NamedTuple, Optional, Tuple

import numpy as np

from benchmarks.faults import USUAL, broken_recordings, source
from mlsm_manager.localisation.localiser import Localiser
from mlsm_manager.localisation.odometry_profiles import OdometryKind, profile_values
from mlsm_manager.localisation.place_now import PlaceNow, PositionState, doubts_of, position_state
from mlsm_manager.offline.heard_scans import with_steady_head
from mlsm_manager.offline.recording import Recording, scans_of
from mlsm_manager.offline.replay import ReplayParameters
from mlsm_manager.scan_matching.scan_path import POSITION
from node_support.errors import RefusedInput
from sonar_processing.beams.parameters import BeamCorrection
from sonar_processing.filters.echo_extractor import EchoExtractor

_COVERS = 2.5  # stated deviations


class Told(NamedTuple):
    """What is told at the end of a scan. time: s. place: (2,) m in map. deviation: m. is_good: whether it is called so.

    causes: that are named, ranked, of what is not mended.
    """

    time: float
    place: np.ndarray
    deviation: float
    is_good: bool
    causes: List[str]


def told_by(recording: Recording, kind: OdometryKind) -> List[Told]:
    """Return what live nodes that are told the kind of the odometry tell, scan by scan, once there is a fix."""
    parameters = ReplayParameters().changed(profile_values(kind))
    localiser = parameters.build_localiser(recording.sonar_in_base)
    recording, _ = with_steady_head(recording)
    beams = recording.corrected(parameters.part(BeamCorrection))
    found, heard = [], 0
    for scan, _ in scans_of(beams, EchoExtractor(parameters.echoes())):
        before, heard = heard, int(np.searchsorted(beams.times, scan.reference_time, side="right"))
        for beam in beams.sent[before:heard]:
            localiser.following.found.hear(beam)
        try:
            localiser.take_scan(scan)
        except RefusedInput:
            continue
        localiser.look_for_causes()
        time, place = scan.reference_time, localiser.estimator.belief.theta[POSITION]
        now = localiser.place_now(time, recording.track.at(np.array(time)))
        if now is not None:
            causes = [cause.text for cause in localiser.following.causes() if not cause.is_mended]
            found.append(Told(time, place, now.deviation, is_called_good(localiser, now), causes))
    return found


def is_called_good(localiser: Localiser, place: Optional[PlaceNow], is_provisional: bool = False) -> bool:
    """Return whether live nodes call a position good."""
    doubts = doubts_of(place, localiser.following.causes(), localiser.verdicts(), {}, "")
    return position_state(place, localiser.is_lost, is_provisional, doubts, "")[0] is PositionState.GOOD


def line(told: List[Told], whole: List[Told], begin: float) -> str:
    """Return the figures of a broken run beside the unbroken one; begin: s, of the fault."""
    times, places = np.array([one.time for one in whole]), np.array([one.place for one in whole])
    right = np.array([[np.interp(one.time, times, axis) for axis in places.T] for one in told])
    off = np.hypot(*(np.array([one.place for one in told]) - right).T)
    stated = np.array([one.deviation for one in told])
    covered = off <= _COVERS * stated
    good = np.array([one.is_good for one in told])
    named = [one.time for one in told if one.causes]
    after = f"after {named[0] - begin:.0f} s" if named else "never"
    return (
        f"{off.mean():6.2f} most {off.max():6.2f} told {np.median(stated):6.2f} covered {100 * covered.mean():3.0f} % "
        f"good {100 * (good & ~covered).mean():3.0f} %  {after}\n    {told[-1].causes[0] if told[-1].causes else '-'}"
    )


def lines(
    rows: str = ".", sources: Tuple[str, ...] = USUAL, seconds: float = 600.0, seed: Optional[int] = None,
    odometry: str = "auto",
) -> Iterator[str]:  # fmt: skip
    """Yield the rows that a regular expression finds in 'SOURCE: FAULT'.

    odometry: as the nodes are told. The other options are those of scripts/bench faults.
    """
    kind = OdometryKind(odometry.upper())
    unbroken = lru_cache(maxsize=None)(lambda name: told_by(source(name, seconds), kind))
    for broken in broken_recordings(rows, sources, seconds, seed):
        whole = unbroken(broken.source)
        told = told_by(broken.make(broken.whole), kind)
        begin = broken.whole.track.times[0] + getattr(broken.make, "keywords", {}).get("at", 0.0)
        yield f"{broken.name:55} {line(told, whole, begin)}"
