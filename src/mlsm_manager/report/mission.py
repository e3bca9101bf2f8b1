"""What a report tells of a mission, as plain arrays."""

from dataclasses import dataclass, field
from typing import Any, Dict, List, Mapping, Optional, Sequence, Tuple

import numpy as np

from georeferencing.origin import Origin
from mlsm_manager.self_check.verdict import RunAnswer, Verdict
from mlsm_manager.surface_map.blocks import Blocks

_ELLIPSE_DEVIATIONS = 2.0
_ANGLES = np.append(np.linspace(0.0, 2.0 * np.pi, 25), np.nan)


@dataclass(frozen=True)
class ScanRecord:
    """One turn of the head.

    time: s, of its last beam. points: (n, 2) m, its echoes in map. beams: how many made it. missing: how many more the
    head would have sent at its own pace. rejection: why it was not used; empty where it was.
    """

    time: float
    points: np.ndarray
    beams: int
    missing: int
    rejection: str = ""


@dataclass(frozen=True)
class Path:
    """A way of the vehicle. times: (m,) s. poses: (m, >= 2) x y [m] in map."""

    name: str
    color: str
    times: np.ndarray
    poses: np.ndarray

    def at(self, times: np.ndarray) -> np.ndarray:
        """Return x y (..., 2) m in map at `times` (...) s."""
        return np.stack([np.interp(times, self.times, self.poses[:, axis]) for axis in (0, 1)], axis=-1)


@dataclass(frozen=True)
class Uncertainty:
    """How certain the last path is. times: (k,) s. covariances: (k, 2, 2) m^2. doubtful: (d, 2) s, stretches of time
    that a check found doubtful.
    """

    times: np.ndarray
    covariances: np.ndarray
    doubtful: np.ndarray

    def ellipses(self, path: Path, most: int) -> np.ndarray:
        """Return outlines (k, 2) m in map of two standard deviations at about `most` places of a path, NaN after each.

        More would hide the path.
        """
        shown = slice(None, None, max(1, len(self.times) // most))
        values, vectors = np.linalg.eigh(self.covariances[shown])
        axes = vectors * (_ELLIPSE_DEVIATIONS * np.sqrt(np.maximum(values, 0.0)))[:, np.newaxis, :]
        outlines = path.at(self.times[shown])[:, :, np.newaxis] + axes @ [np.cos(_ANGLES), np.sin(_ANGLES)]
        return outlines.transpose(0, 2, 1).reshape(-1, 2)

    def doubtful_parts(self, path: Path) -> np.ndarray:
        """Return the places (k, 2) m in map of a path in the doubtful stretches, NaN after each stretch."""
        inside = [(path.times >= begin) & (path.times <= end) for begin, end in self.doubtful]
        parts = [np.append(path.poses[some, :2], [[np.nan, np.nan]], axis=0) for some in inside]
        return np.concatenate([np.empty((0, 2)), *parts])


@dataclass(frozen=True)
class Mission:
    """Everything that the report shows.

    title: names of the recordings. headline: whether the run can be trusted. paths: the first is the odometry, the last
    one the best. scans: oldest first, at least one. verdicts: of all checks; none where none was made.
    calibration: name -> (value, deviation). facts: name -> value, for the head of the page. parameters: name -> value.
    further: ways of further recordings, which are shown in the map only. origin: where the map lies, if that is known.
    answer: how it came out.
    """

    title: str
    headline: str
    paths: List[Path]
    scans: List[ScanRecord]
    blocks: Blocks
    verdicts: List[Verdict]
    calibration: Mapping[str, Tuple[float, float]]
    facts: Mapping[str, str]
    parameters: Mapping[str, Any]
    uncertainty: Optional[Uncertainty] = None
    errors: Dict[str, Dict[str, float]] = field(default_factory=dict)
    further: Sequence[Path] = ()
    origin: Optional[Origin] = None
    answer: RunAnswer = RunAnswer.UNMEASURED

    @property
    def best(self) -> Path:
        return self.paths[-1]

    @property
    def start(self) -> float:
        """Time [s] that the report counts from."""
        return float(self.best.times[0])
