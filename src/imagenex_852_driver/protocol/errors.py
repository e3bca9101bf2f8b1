"""What is wrong with a frame, and the checks that commands and replies share."""

from typing import Any, Container

RANGES = (5, 10, 20, 30, 40, 50)  # m: the only ranges that the head takes (manufacturer's specification)
SONAR_HEAD_ID = 0x10  # As delivered (manufacturer's specification)
HEAD_IDS = range(0x10, 0x16)


class FrameError(ValueError):
    """A frame, or a value meant for one, that the protocol does not allow; the text names field and value."""


def require(name: str, value: Any, allowed: Container) -> None:
    """Raise FrameError unless `value` is in `allowed`."""
    if value not in allowed:
        raise FrameError(f"{name} = {value!r}: not allowed by the protocol, which takes {_in_words(allowed)}")


def _in_words(allowed: Container) -> str:
    if not isinstance(allowed, range):
        return ", ".join(str(value) for value in allowed)
    steps = f" in steps of {allowed.step}" if allowed.step != 1 else ""
    return f"{allowed[0]} to {allowed[-1]}{steps}"
