"""Times of messages."""

from typing import Any


def nanoseconds(time: Any) -> int:
    """Return a time with `sec` and `nanosec` in ns."""
    return int(time.sec) * 10**9 + int(time.nanosec)


def stamp_ns(message: Any) -> int:
    """Return the stamp of a message's header, ns."""
    return nanoseconds(message.header.stamp)
