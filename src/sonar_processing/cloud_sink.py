"""Where a stage hands its clouds to within the process."""

from dataclasses import dataclass
from typing import Callable

from sonar_processing.cloud import IntensityCloud


@dataclass(frozen=True)
class CloudSink:
    """take: what happens to a cloud. is_wanted: whether anybody takes what is made of it; otherwise it is not made."""

    take: Callable[[IntensityCloud], None]
    is_wanted: Callable[[], bool] = lambda: True
