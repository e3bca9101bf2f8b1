"""Is the place of all scans in the map known, or do some lie apart since the sonar heard nothing for a while?"""

from typing import Tuple

import numpy as np

from mlsm_manager.self_check.verdict import Verdict, merged


def in_one_map(times: np.ndarray, apart: np.ndarray) -> Tuple[Verdict, ...]:
    """Return a verdict on the share of scans whose place in the map is known; none where that is every scan's.

    times: (n,) s of the scans' ends. apart: (n,) bool, whether a scan lies where nobody knows how it fits to the map.
    """
    if not apart.any():
        return ()
    share, step = float(1.0 - apart.mean()), float(np.median(np.diff(times))) if len(times) > 1 else 0.0
    text = "share of the scans whose place in the map is known; after a silence the others fit at none, or at several"
    question = "Is the place in the map of all scans known, also after the sonar heard nothing for a while?"
    return (Verdict("one map", share, 1.0, text, True, merged(times[apart] - step, step), question),)
