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
    assumed: str = "", if_so: float = np.nan,
) -> str:  # fmt: skip
    """Return what the checks of a run say.

    causes: of what is wrong, ranked, in a run that began at `begin` [s]. matched: scans that were compared with the
    surfaces of others. deviation: m, the largest stated one, root of the sum of both variances. assumed: what nobody
    measured and the path rests on, if anything. if_so: m, the largest deviation if that is so; NaN where nothing tells.
    """
    fine, doubtful, missing = ([one for one in verdicts if one.answer is answer] for answer in Answer)
    within = _within(deviation if np.isnan(if_so) else if_so)
    wrong = [cause.line(begin) for cause in causes if not cause.is_mended]
    mended = "".join(f"; mended: {cause.line(begin)}" for cause in causes if cause.is_mended)
    known = f"position {within}" if is_told(verdicts, matched, assumed, if_so) else ""
    nothing = "nothing can be said of the position"
    if wrong or doubtful:
        said = "; ".join([*wrong, *(one.text for one in doubtful)])
        return f"trust: DOUBTFUL: {said}{mended}; {f'at best {known}' if known else nothing}"
    if matched < FEWEST_MATCHED or not fine:
        reason = assumed or f"none of {len(verdicts)} checks had enough data"
        if matched < FEWEST_MATCHED:
            reason = f"{counted(matched, 'scan')} matched, {FEWEST_MATCHED} needed"
        otherwise = f", {_within(deviation)} if not" if deviation > if_so else ""
        return f"trust: NOT MEASURED: {reason}; {f'{known} if so{otherwise}' if known else nothing}{mended}"
    if missing:
        names = ", ".join(one.name for one in missing)
        told = f"{len(fine)} of {len(verdicts)} checks are fine, NOT MEASURED: {names}"
        return f"trust: {told}; {known} if these are fine too{mended}"
    return f"trust: all {len(verdicts)} checks are fine, nothing contradicts: {known}{mended}"


def _within(deviation: float) -> str:
    return f"within {WITHIN * deviation:.1f} m"


def is_told(verdicts: Sequence[Verdict], matched: int, assumed: str = "", if_so: float = np.nan) -> bool:
    """Return whether the checks of a run say anything of the position; arguments as those of `headline`."""
    answers = {verdict.answer for verdict in verdicts}
    is_fine = Answer.FINE in answers or (not np.isnan(if_so) and any(one.text == assumed for one in verdicts))
    return Answer.DOUBTFUL in answers or (is_fine and matched >= FEWEST_MATCHED)
