"""A recording without what its beams or its odometry alone show to be wrong, and the causes."""

from dataclasses import replace
from typing import List, Tuple

import numpy as np

from mlsm_manager.odometry.mending import mended
from mlsm_manager.odometry.steps import MotionLimits
from mlsm_manager.offline.recording import Recording
from mlsm_manager.self_check.beam_causes import of_trembling
from mlsm_manager.self_check.causes import Cause, of_steps, of_stuck
from mlsm_manager.self_check.standing_head import head_stood, of_standing
from sonar_processing.beams.steady_head import steadied

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
