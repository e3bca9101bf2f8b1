"""One line for people: what contradicts, what was not measured, and how well the position is known."""

from typing import Sequence

import numpy as np

from mlsm_manager.self_check.causes import Cause
from mlsm_manager.self_check.verdict import Answer, Verdict
from node_support.errors import counted

WITHIN = float(np.sqrt(-2.0 * np.log(0.05) / 2.0))  # radius that holds 95 %, over the root of both variances' sum
FEWEST_MATCHED = 3  # scans: two tell how they lie to each other, a third one whether that holds


def headline(
    verdicts: Sequence[Verdict], matched: int, deviation: float, causes: Sequence[Cause] = (), begin: float = 0.0,
    assumed: str = "",
) -> str:  # fmt: skip
    """Return what the checks of a run say.

    causes: of what is wrong, ranked, in a run that began at `begin` [s]. matched: scans that were compared with the
    surfaces of others. deviation: m, the largest stated one, root of the sum of both variances. assumed: what nobody
    measured and the path rests on, if anything.
    """
    by_answer = {answer: [one for one in verdicts if one.answer is answer] for answer in Answer}
    doubtful, missing = by_answer[Answer.DOUBTFUL], by_answer[Answer.NOT_MEASURED]
    within = f"position within {WITHIN * deviation:.1f} m"
    wrong = [cause.line(begin) for cause in causes if not cause.is_mended]
    mended = "".join(f"; mended: {cause.line(begin)}" for cause in causes if cause.is_mended)
    if wrong or doubtful:
        said = "; ".join([*wrong, *(one.text for one in doubtful)])
        known = f"at best {within}" if is_told(verdicts, matched) else "nothing can be said of the position"
        return f"trust: DOUBTFUL: {said}{mended}; {known}"
    reason = f"{counted(matched, 'scan')} matched, {FEWEST_MATCHED} needed" if matched < FEWEST_MATCHED else ""
    if not reason and not by_answer[Answer.FINE]:
        reason = assumed or f"none of {len(verdicts)} checks had enough data"
    if reason:
        return f"trust: NOT MEASURED: {reason}; nothing can be said of the position{mended}"
    if missing:
        names, count = ", ".join(one.name for one in missing), len(by_answer[Answer.FINE])
        fine = f"{count} of {len(verdicts)} checks are fine, NOT MEASURED: {names}"
        return f"trust: {fine}; {within} if these are fine too{mended}"
    return f"trust: all {len(verdicts)} checks are fine, nothing contradicts: {within}{mended}"


def is_told(verdicts: Sequence[Verdict], matched: int) -> bool:
    """Return whether the checks of a run say anything of the position."""
    answers = {verdict.answer for verdict in verdicts}
    return Answer.DOUBTFUL in answers or (Answer.FINE in answers and matched >= FEWEST_MATCHED)
