"""What moves a vehicle: its state at any time, wherever that comes from."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np


@dataclass(frozen=True)
class VehicleState:
    """Where the vehicle truly is and how it moves.

    T_world_base: (4, 4). twist: (6,) in the body frame, linear x y z m/s, angular x y z rad/s. is_still: it rests.
    """

    T_world_base: np.ndarray
    twist: np.ndarray
    is_still: bool


class Movement(Protocol):
    """A vehicle on its way."""

    duration: float
    """When the way ends, s since its start; inf where it has no end."""

    def state(self, time: float) -> VehicleState:
        """Return the state at `time` s since the start; times must not decrease from call to call."""
