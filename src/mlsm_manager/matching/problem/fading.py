"""How errors of the odometry's speed go on after a belief, where a model of the vehicle's motion says so."""

from dataclasses import dataclass, replace

import numpy as np


@dataclass(frozen=True)
class Fading:
    """Errors of speed and turn rate return to what is usual (the mean of an Ornstein-Uhlenbeck process).

    usual: (3,) m/s, m/s, rad/s in base_link. times: (3,) s within which their differences from it fall to a third;
    infinity where they stay.
    """

    usual: np.ndarray
    times: np.ndarray

    def after(self, rates: np.ndarray, seconds: float) -> np.ndarray:
        """Return the errors (3,) that are expected `seconds` after they were `rates` (3,)."""
        return self.usual + np.exp(-seconds / self.times) * (rates - self.usual)

    def to_a_stop(self) -> "Fading":
        """Return one with which the vehicle comes to rest."""
        return replace(self, usual=np.zeros_like(self.usual))
