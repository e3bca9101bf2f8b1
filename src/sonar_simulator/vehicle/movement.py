"""The state of a vehicle at any time, and the interface of whatever moves it."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np


@dataclass(frozen=True)
class VehicleState:
    """The vehicle's true pose and velocity.

    T_world_base: (4, 4). twist: (6,) in the body frame, linear x y z m/s, angular x y z rad/s. is_still: at rest.
    """

    T_world_base: np.ndarray
    twist: np.ndarray
    is_still: bool


class Movement(Protocol):
    """A vehicle in motion."""

    duration: float
    """When the motion ends, s since its start; inf if it has no end."""

    def state(self, time: float) -> VehicleState:
        """Return the state at `time` s since the start; times must not decrease from call to call."""
