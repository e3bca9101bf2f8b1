"""Stamps that stand while what they tell of goes on."""

from collections import deque
from typing import Deque, Dict, Hashable, Tuple

_FEWEST = 5  # changes under one stamp: some publishers correct what they have just said
_MOST_TOLD = 100


class StandingClock:
    """Watches the stamps [ns] of senders whose messages differ.

    stood: from which stamp to which one [s] a clock went on after it had stood: what happened meanwhile looks sudden.
    """

    def __init__(self) -> None:
        self.stood: Deque[Tuple[float, float]] = deque(maxlen=_MOST_TOLD)
        self._newest: Dict[Hashable, Tuple[int, object, int]] = {}

    def take(self, sender: Hashable, stamp_ns: int, said: object) -> bool:
        """Learn a message; return whether it is the one that shows that its clock stands."""
        stamp, before, changes = self._newest.get(sender, (0, said, 0))
        if stamp_ns != stamp:
            if changes >= _FEWEST and stamp_ns > stamp:
                self.stood.append((stamp * 1e-9, stamp_ns * 1e-9))
            changes = 0
        elif said != before:
            changes += 1
        self._newest[sender] = stamp_ns, said, changes
        return stamp_ns == stamp and said != before and changes == _FEWEST

    def stands_at(self, stamp_ns: int) -> bool:
        return any(changes >= _FEWEST and stamp <= stamp_ns for stamp, _, changes in list(self._newest.values()))
