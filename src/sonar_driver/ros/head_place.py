"""Where a moving emulated head is, from tf."""

from typing import Callable, Optional

import numpy as np

from node_support.health import Health
from node_support.ros.transforms import TfBuffer

WORLD_FRAME = "world"
"""Frame of the world file that the emulated head hears."""

Place = Callable[[], Optional[np.ndarray]]
"""Returns the (4, 4) T_world_head of now; None where it is not known."""


def place_in_tf(frame: str, health: Health) -> Place:
    """Return what looks up the newest place of `frame` in the world; pings before tf knows it are counted."""
    transforms = TfBuffer(health)

    def place() -> Optional[np.ndarray]:
        found = transforms.newest(WORLD_FRAME, frame)
        if found is None:
            health.problem("pings without a place", f"tf does not know {frame!r} in {WORLD_FRAME!r}; see head_frame")
            return None
        return found[1]

    return place
