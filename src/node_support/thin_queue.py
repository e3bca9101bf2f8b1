"""What waits for a link of few bytes a second: of each thing the newest, the most urgent first."""

from dataclasses import dataclass
from typing import Any, Dict, Hashable, List

from node_support.parameters import ParameterSet, parameter

_BURST = 1.0  # s of the link that may be sent at once after a pause


@dataclass(frozen=True)
class ThinLinkParameters(ParameterSet):
    bytes_per_second: float = parameter(
        24000.0, "bytes that are sent in a second; leave a quarter of the link to ROS itself", low=100.0, high=1e9
    )
    slow_period: float = parameter(
        20.0, "time between two paths, images and diagnostics", unit="s", low=0.1, high=3600.0
    )


@dataclass(frozen=True)
class Waiting:
    """item: what is sent. size: of it, bytes. priority: lower ones go first. turn: since when it waits."""

    item: Any
    size: int
    priority: int
    turn: int


class ThinQueue:
    """Gives out what is put in, no faster than the link takes it."""

    def __init__(self, bytes_per_second: float) -> None:
        self._rate = bytes_per_second
        self._waiting: Dict[Hashable, Waiting] = {}
        self._turns = 0
        self._budget = bytes_per_second * _BURST
        self._now = 0.0

    @property
    def waiting_bytes(self) -> int:
        return sum(one.size for one in self._waiting.values())

    def put(self, key: Hashable, item: Any, size: int, priority: int) -> None:
        """Let an item of `size` bytes wait in the place of the older one with its key, where there is one."""
        self._turns += 1
        before = self._waiting.get(key)
        turn = self._turns if before is None else before.turn
        self._waiting[key] = Waiting(item, size, priority, turn)

    def drop(self, keys: List[Hashable]) -> None:
        for key in keys:
            self._waiting.pop(key, None)

    def take(self, now: float) -> List[Waiting]:
        """Return what the link takes by `now` [s]; the last of it may be larger than that, and then delays others."""
        self._budget = min(self._budget + (now - self._now) * self._rate, self._rate * _BURST)
        self._now = now
        sent = []
        for key in sorted(self._waiting, key=lambda key: (self._waiting[key].priority, self._waiting[key].turn)):
            if self._budget <= 0.0:
                break
            sent.append(self._waiting.pop(key))
            self._budget -= sent[-1].size
        return sent
