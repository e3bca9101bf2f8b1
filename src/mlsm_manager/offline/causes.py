"""What a recording says of its own faults before it is mapped, and what can be mended of them."""

from typing import List, Tuple

from mlsm_manager.odometry.mending import mended
from mlsm_manager.odometry.steps import MotionLimits
from mlsm_manager.offline.recording import Recording
from mlsm_manager.self_check.causes import CERTAIN, Cause, of_steps


def with_odometry_mended(recording: Recording, limits: MotionLimits) -> Tuple[Recording, List[Cause]]:
    """Return a recording whose odometry goes where a vehicle can have gone, and what was wrong with it."""
    track, steps, held = mended(recording.track, limits)
    causes = of_steps(steps)
    causes += [
        Cause(f"odometry held for {end - begin:.0f} s, and then right again,", CERTAIN, begin, True)
        for begin, end in held
    ]
    if not causes:
        return recording, []
    return recording.with_track(track), causes
