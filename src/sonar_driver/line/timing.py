"""How long bytes take on a serial line."""

_BITS_PER_BYTE = 10  # 8N1: one start bit, eight data bits, one stop bit


def transmission_time(byte_count: int, baud_rate: float) -> float:
    """Return how long `byte_count` bytes take at `baud_rate` bit/s, in seconds; no time at an infinite rate."""
    return byte_count * _BITS_PER_BYTE / baud_rate
