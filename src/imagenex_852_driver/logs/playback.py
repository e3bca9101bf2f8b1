"""When the pings of a log were recorded, as far as that can be known."""

from typing import Iterable, Iterator, Optional, Tuple

from imagenex_852_driver.logs.log_record import LoggedPing

USUAL_RATE = 10.0  # 1/s: pings of a head at 30 m, for logs whose stamps do not tell


def timed(pings: Iterable[LoggedPing], rate: Optional[float] = None) -> Iterator[Tuple[float, LoggedPing]]:
    """Yield every ping with its time in seconds after the first one; times never go back.

    They follow each other at `rate` (1/s). Without a rate they keep the intervals of the log's stamps, or follow
    at `USUAL_RATE` where the stamps cannot be read.
    """
    step = 1.0 / (rate or USUAL_RATE)
    time, last_stamp = 0.0, None
    for index, ping in enumerate(pings):
        if index:
            known = rate is None and ping.stamp is not None and last_stamp is not None
            time += max(0.0, ping.stamp - last_stamp) if known else step
        last_stamp = ping.stamp
        yield time, ping
