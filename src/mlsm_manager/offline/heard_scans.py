"""The scans of a recording, without what its beams or odometry show to be wrong, and as its sonar is mounted."""

import sys
from argparse import Namespace
from dataclasses import replace
from typing import List, NamedTuple, Tuple

import numpy as np
from tqdm import tqdm

from mlsm_manager.localisation.odometry_profiles import COMPASS_ONLY, OdometryKind
from mlsm_manager.odometry.changed_tracks import Mirror
from mlsm_manager.odometry.mending import mended
from mlsm_manager.odometry.steps import MotionLimits
from mlsm_manager.offline.recording import Recording, scans_of, whole_turns
from mlsm_manager.scan_matching.scan import Scan
from mlsm_manager.self_check.beam_causes import head_stood, of_standing, of_trembling
from mlsm_manager.self_check.causes import CERTAIN, Cause, of_steps, of_stuck
from mlsm_manager.self_check.echo_causes import TURN_DEVIATION, EchoFindings, echo_findings, turn_text
from mlsm_manager.self_check.north_east_down import ZDownSigns, z_down_signs
from mlsm_manager.self_check.scan_pairs import AS_TOLD, Hypothesis
from sonar_processing.beams.steady_head import steadied
from sonar_processing.filters.echo_extractor import EchoExtractor

_OVER = Cause(turn_text(Hypothesis(is_over=True)), CERTAIN, turn=np.pi)  # if it is the odometry, the path is mirrored
_MOSTLY = 0.9  # share of the beams whose angles are mended: then those of the head are


def with_steady_head(recording: Recording) -> Tuple[Recording, List[Cause]]:
    """Return a recording whose head's angles do not tremble, and what was wrong with it."""
    found = steadied(recording.sent)
    if found is None:
        return recording, []
    beams = [replace(placed, beam=beam) for placed, beam in zip(recording.beams, found.beams)]
    return replace(recording, beams=beams), [of_trembling(np.degrees(found.deviation), found.share > _MOSTLY)]


def with_turning_head(recording: Recording) -> Tuple[Recording, List[Cause]]:
    """Return a recording without what a head that stood heard, and what was wrong with it."""
    stood, _ = head_stood(recording.sent)
    for one in stood:
        recording = recording.without_beams(one.begin, one.end)
    return recording, of_standing(stood)


def with_odometry_mended(recording: Recording, limits: MotionLimits) -> Tuple[Recording, List[Cause]]:
    """Return a recording whose odometry goes where a vehicle can have gone, and what was wrong with it."""
    track, steps, stuck, untold = mended(recording.track, limits)
    causes = [*of_steps(steps), *(of_stuck(*one) for one in stuck)]
    if not causes:
        return recording, []
    for begin, end in untold:
        recording = recording.without_beams(begin, end)
    return recording.with_track(track), causes


class Heard(NamedTuple):
    """recording: as its echoes place it. mounted: what was put right of its mount, because that is asked for.

    over: whether the sonar was taken for upside down, as a cause; none where not.
    """

    recording: Recording
    scans: List[Scan]
    mounted: List[Cause]
    signs: ZDownSigns
    over: List[Cause]


def heard_in(
    recording: Recording, kind: OdometryKind, extractor: EchoExtractor, options: Namespace
) -> Heard:  # fmt: skip
    """Return the scans of a recording, whose mount is put right where that is asked for.

    Where a compass alone turns against the echoes, it is taken for mirrored: else nothing lies on what was heard.
    """
    scans, mended = _scans(recording, extractor, options), []
    found = echo_findings(scans, recording.sonar_in_base) if options.fix_mount else EchoFindings([], AS_TOLD)
    if found.mount != AS_TOLD and found.mount.mirrored is Mirror.NOTHING:
        recording = recording.mounted(found.mount.turn, found.mount.is_over)
        scans = _scans(recording, extractor, options)
        mended = [replace(cause, is_mended=True, turn=TURN_DEVIATION, metres=0.0) for cause in found.causes]
    signs = z_down_signs(np.array([placed.T_target_sonar[2, 3] for placed in recording.beams]), scans)
    _warn_of_z_down(signs, options)
    if kind not in COMPASS_ONLY or not signs.turns().fires:
        return Heard(recording, scans, mended, signs, [])
    mirrored = recording.mounted(0.0, True)
    return Heard(mirrored, _scans(mirrored, extractor, options), mended, signs, [_OVER])


def _scans(recording: Recording, extractor: EchoExtractor, options: Namespace) -> List[Scan]:
    with progress_bar(len(recording.beams), "beam", "echoes") as bar:
        chain = options.chain
        found = scans_of(recording, extractor) if chain is None else chain.scans(recording)
        return whole_turns(options.bags[0], len(recording.beams), found, bar.update)


def _warn_of_z_down(signs: ZDownSigns, options: Namespace) -> None:
    advice = "leave --ned out" if options.ned else "if the odometry counts north, east, down, give --ned"
    advice += "; if the head turns the other way, set head_turns"
    for sign in signs.lines():
        print(f"map_bag: {options.bags[0]}: {sign}; {advice}", file=sys.stderr)


def progress_bar(total: int, unit: str, name: str) -> tqdm:
    """Return a bar of one stage of mapping, which a terminal shows."""
    return tqdm(total=total, unit=unit, desc=f"{name:9}", disable=None)
