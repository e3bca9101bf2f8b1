"""What a recording says of its own faults before it is mapped, and what can be mended of them."""

from typing import List, Sequence, Tuple

import numpy as np

from mlsm_manager.odometry.mending import mended
from mlsm_manager.odometry.steps import MotionLimits, Step, StepKind
from mlsm_manager.offline.recording import Recording
from mlsm_manager.self_check.causes import Cause

_CERTAIN = 1e3  # nats: of what needs no echo to be seen
_FEW = 3  # steps that are told one by one
_LEFT = 0.5  # m: by which the vehicle may move while its odometry jumps, besides what it did just before


def with_odometry_mended(recording: Recording, limits: MotionLimits) -> Tuple[Recording, List[Cause]]:
    """Return a recording whose odometry goes where a vehicle can have gone, and what was wrong with it."""
    track, steps, held = mended(recording.track, limits)
    causes = [cause for kind in StepKind for cause in _of_steps([step for step in steps if step.kind is kind])]
    causes += [
        Cause(f"odometry held for {end - begin:.0f} s, and then right again,", _CERTAIN, begin, True)
        for begin, end in held
    ]
    if not causes:
        return recording, []
    return recording.with_track(track), causes


def _of_steps(steps: Sequence[Step]) -> List[Cause]:
    """Return a cause for each of a few steps of one kind, and one for all of many."""
    if len(steps) <= _FEW:
        return [Cause(step.text, _CERTAIN + step.size, step.time, True, metres=_LEFT) for step in steps]
    most = max(steps, key=lambda step: (step.size, abs(step.turn)))
    text = f"{most.text} at most, {len(steps)} times, first"
    return [Cause(text, _CERTAIN + most.size, steps[0].time, True, metres=_LEFT * float(np.sqrt(len(steps))))]
