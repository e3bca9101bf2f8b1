"""The cloud that travels from stage to stage, and where a stage hands it to within the process."""

from dataclasses import dataclass, replace
from typing import Callable

import numpy as np

from node_support.errors import RefusedInput

HIGHEST_STRENGTH = 255  # Of an echo; sonars send bytes
# Returns T_frame_sonar (m, 4, 4) in a frame at times (m,) [s], NaN where nobody knows it.
SonarPoses = Callable[[str, np.ndarray], np.ndarray]
_FOUR_TRUE = np.ones(4, dtype=bool).view(np.uint32)[0]


@dataclass(frozen=True)
class Cloud:
    """Points with echo strength and time. Raises RefusedInput when points and stamps do not belong together.

    points: (n, 4) float32, x y z [m] in `frame_id`, echo strength; removed points of an organised cloud are NaN.
    time_stamps: (n,) float64, seconds at which each point's beam was taken, negative while the vehicle was still,
        positive while it was moving (thesis 4.5.1).
    stamp_ns: stamp of the newest beam, nanoseconds.
    height: rows (beams) of an organised cloud, 1 otherwise.
    organized: whether rows are beams and columns are bins; always so with more than one row.
    """

    points: np.ndarray
    time_stamps: np.ndarray
    stamp_ns: int
    frame_id: str
    height: int = 1
    organized: bool = False

    def __post_init__(self) -> None:
        points, stamps = len(self.points), len(self.time_stamps)
        if points != stamps:
            raise RefusedInput("clouds refused", f"{points} points but {stamps} time stamps; check the publisher")
        if self.height < 1 or points % self.height:
            raise RefusedInput("clouds refused", f"{points} points do not fill {self.height} rows; check the publisher")
        object.__setattr__(self, "organized", self.organized or self.height > 1)

    def __len__(self) -> int:
        return len(self.points)

    @property
    def valid(self) -> np.ndarray:
        """(n,) bool: points whose coordinates, strength and stamp are all finite."""
        finite = np.ascontiguousarray(np.isfinite(self.points))
        # Four booleans compared as one number take a tenth of the time of all(axis=1).
        return (finite.view(np.uint32)[:, 0] == _FOUR_TRUE) & np.isfinite(self.time_stamps)

    @property
    def broken(self) -> int:
        """Number of points that are not finite although no stage removed them; organised clouds hold removed ones."""
        return 0 if self.organized else len(self) - int(np.count_nonzero(self.valid))

    def beyond(self, limit: float) -> np.ndarray:
        """Return (n,) bool: points with a coordinate beyond `limit` [m], infinite ones too; NaN is not."""
        with np.errstate(invalid="ignore"):
            return (np.abs(self.points[:, :3]) > limit).any(axis=1)

    def select(self, keep: np.ndarray) -> "Cloud":
        """Return the cloud with the points where `keep` (n,) bool holds, stamps staying with their points.

        An organised cloud keeps its shape: the other points become NaN.
        """
        if self.organized:
            return replace(self, points=np.where(keep[:, np.newaxis], self.points, np.float32(np.nan)))
        return self.take(np.flatnonzero(keep))

    def take(self, places: np.ndarray) -> "Cloud":
        """Return the cloud with the points of these numbers (m,), ascending, as `select` does."""
        if self.organized:
            keep = np.zeros(len(self), dtype=bool)
            keep[places] = True
            return self.select(keep)
        return replace(self, points=self.points.take(places, axis=0), time_stamps=self.time_stamps.take(places))


@dataclass(frozen=True)
class CloudSink:
    """take: what happens to a cloud. is_wanted: whether anybody takes what is made of it; otherwise it is not made."""

    take: Callable[[Cloud], None]
    is_wanted: Callable[[], bool] = lambda: True


NOBODY = CloudSink(lambda cloud: None, lambda: False)
