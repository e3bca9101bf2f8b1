"""Pairs of those that belong to the same group."""

from typing import Tuple

import numpy as np


def pairs_of_groups(starts: np.ndarray, count: int, owners: np.ndarray) -> Tuple[np.ndarray, np.ndarray]:
    """Return all pairs (p,), (p,) of an index into `owners` and a member of its group.

    Members 0 to `count` - 1 are sorted by group; group g begins at `starts[g]`. owners: (n,) the group of each.
    """
    sizes = np.diff(np.append(starts, count))[owners]
    owner = np.repeat(np.arange(len(owners)), sizes)
    rank = np.arange(len(owner)) - np.repeat(np.cumsum(sizes) - sizes, sizes)
    return owner, starts[owners][owner] + rank
