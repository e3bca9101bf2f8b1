"""Signs of which way the axes of a vehicle's frames point."""

import re
from itertools import islice
from typing import Any, List, Optional

import numpy as np

from recordings.bags.bag import Bag
from recordings.messages.roles import Role, with_role

_NED = re.compile(r"(^|[_/])(ned|frd)($|[_/])")
# Messages of an Imu that are looked at; a vehicle does not pitch for that long.
_IMU_MESSAGES = 200
# m/s^2: half of gravity, as a level vehicle's z axis feels it.
_HALF_GRAVITY = 4.9


def signs_of_z_down(bag: Bag, frames: List[str]) -> List[str]:
    """Return one sentence for each sign that frames count north, east, down, or forward, right, down."""
    named = [name for name in [*frames, *bag.topics] if _NED.search(name.lower())]
    signs = [f"{', '.join(sorted(named))}: named so"] if named else []
    for topic in with_role(bag.topics, Role.HEADING):
        felt = _gravity(bag, topic.name)
        if felt is not None and felt < -_HALF_GRAVITY:
            signs.append(f"{topic.name} feels gravity along -z, {felt:.1f} m/s2: its frame has z down")
    return signs


def _gravity(bag: Bag, topic: str) -> Optional[float]:
    """Return what the z axis of an Imu feels on average, m/s^2; None for another type or without messages."""
    found = [_felt(message) for _, message in islice(bag.messages(topic), _IMU_MESSAGES)]
    known = [value for value in found if value is not None and np.isfinite(value)]
    return float(np.mean(known)) if known else None


def _felt(message: Any) -> Optional[float]:
    acceleration = getattr(message, "linear_acceleration", None)
    return None if acceleration is None else acceleration.z
