"""What a picture of a map shows beside the blocks; loaded without matplotlib."""

from dataclasses import dataclass
from typing import List

import numpy as np


@dataclass(frozen=True)
class Path2d:
    """A line in the top view: (n, 2) x y [m], its label and color."""

    points: np.ndarray
    label: str
    color: str


@dataclass(frozen=True)
class Doubts:
    """How certain the last path is. centers: (k, 2) m. covariances: (k, 2, 2) m^2 there. stretches: each (n, 2) m,
    parts of the path that a check found doubtful.
    """

    centers: np.ndarray
    covariances: np.ndarray
    stretches: List[np.ndarray]
