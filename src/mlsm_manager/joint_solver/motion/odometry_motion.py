"""What the odometry reported up to some times."""

from dataclasses import dataclass
from typing import Union

import numpy as np


@dataclass(frozen=True)
class Motion:
    """times: (m,) s. poses: (m, 3) T_odom_base. ahead: (m, 2) m, where a vehicle would be that always went ahead.

    "Ahead" is along the reported heading, at 1 m/s since the run began: a path for an odometry that reports no other.
    """

    times: np.ndarray
    poses: np.ndarray
    ahead: np.ndarray

    def __len__(self) -> int:
        return len(self.times)

    def __getitem__(self, rows: Union[slice, np.ndarray]) -> "Motion":
        """Return the motion at `rows`: a slice or an array of indices."""
        return Motion(self.times[rows], self.poses[rows], self.ahead[rows])

    @property
    def durations(self) -> np.ndarray:
        """(m - 1,) s between the times."""
        return np.diff(self.times)

    @property
    def positions(self) -> np.ndarray:
        """(m,) complex x + i y [m] in odom."""
        return as_complex(self.poses)


def as_complex(vectors: np.ndarray) -> np.ndarray:
    """Return x + i y (...) of vectors (..., >= 2)."""
    return vectors[..., 0] + 1j * vectors[..., 1]


def product(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Return the products (...) of complex numbers.

    numpy's own product rounds by where in memory the numbers lie, so that equal runs would end differently.
    """
    real = first.real * second.real - first.imag * second.imag
    return real + 1j * (first.real * second.imag + first.imag * second.real)
