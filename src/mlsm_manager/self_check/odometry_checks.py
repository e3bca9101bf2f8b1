"""Whether the echoes tell which odometry a vehicle has."""

from typing import Optional, Tuple

from mlsm_manager.joint_solver.hypotheses import Doubt
from mlsm_manager.self_check.verdict import Verdict

_LEAST = 1.0  # m: less does not matter to a map


def odometry_decided(doubt: Optional[Doubt]) -> Tuple[Verdict, ...]:
    """Return whether the odometry that is not believed makes the position more uncertain than all the rest does.

    None where there is only one.
    """
    if doubt is None:
        return ()
    limit = max(doubt.own, _LEAST)
    text = "it is clear" if doubt.deviation <= limit else "it is not clear"
    text += f" which odometry the vehicle has ({doubt.told}; with {doubt.other} it is {doubt.apart:.1f} m elsewhere, "
    text += f"which adds {doubt.deviation:.1f} m to the stated deviation, limit {limit:.1f} m)"
    question = "Do the echoes tell whether the distances are a DVL's, where the profile auto leaves that open?"
    return (Verdict("odometry decided", doubt.deviation, limit, text, question=question),)
