"""One line for people: what contradicts, what was not measured, and how well the position is known."""

from typing import Sequence

import numpy as np

from mlsm_manager.self_check.verdict import Answer, Verdict

_WITHIN = float(np.sqrt(-2.0 * np.log(0.05) / 2.0))  # radius that holds 95 %, over the root of both variances' sum
_FEWEST_MATCHED = 3  # scans: two tell how they lie to each other, a third one whether that holds


def headline(verdicts: Sequence[Verdict], matched: int, deviation: float) -> str:
    """Return what the checks of a run say.

    matched: scans that were compared with the surfaces of others. deviation: m, the largest stated one, root of the
    sum of both variances.
    """
    by_answer = {answer: [one for one in verdicts if one.answer is answer] for answer in Answer}
    doubtful, missing = by_answer[Answer.DOUBTFUL], by_answer[Answer.NOT_MEASURED]
    within = f"position within {_WITHIN * deviation:.1f} m"
    if doubtful:
        return f"trust: DOUBTFUL: {'; '.join(one.text for one in doubtful)}; at best {within}"
    reason = f"{matched} scans matched, {_FEWEST_MATCHED} needed" if matched < _FEWEST_MATCHED else ""
    if not by_answer[Answer.FINE]:
        reason = f"none of {len(verdicts)} checks had enough data"
    if reason:
        return f"trust: NOT MEASURED: {reason}; nothing can be said of the position"
    if missing:
        names = ", ".join(one.name for one in missing)
        count = len(by_answer[Answer.FINE])
        return (
            f"trust: {count} of {len(verdicts)} checks are fine, NOT MEASURED: {names}; {within} if these are fine too"
        )
    return f"trust: all {len(verdicts)} checks are fine, nothing contradicts: {within}"
