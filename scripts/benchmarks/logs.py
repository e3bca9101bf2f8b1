"""Is the map of each recording of a folder, as it is, as sharp as its fullest single sweep?"""

from pathlib import Path
from typing import Iterator, List

import numpy as np

from benchmarks.harness import mapped_as
from mlsm_manager.offline.bag_mapping import MappedBag
from mlsm_manager.offline.each import recordings_in
from mlsm_manager.offline.recording import read_recording
from recordings.bags.bag import RecordingError
from recordings.reader import Request

_METRE = 1.0  # m: a surface has about one such cell for each metre of its length
_DRAWS = 20  # of echoes: their mean differs by less than 0.02 from one seed to another


def _cells(places: np.ndarray, side: float) -> int:
    """Return how many cells of a side [m] hold some of the places (n, 2)."""
    return len(np.unique(np.floor(places / side), axis=0))


def _blocks_per_metre(places: np.ndarray, side: float) -> float:
    """Return how many blocks of a side [m] surfaces have for each metre, NaN where there are none.

    places: (n, 2) m, of echoes or blocks. Thin surfaces have about one metre over the side, blurred ones more, and
    those of which less than an echo for each block was heard fewer: only figures of equally many echoes compare.
    """
    return _cells(places, side) / _cells(places, _METRE) if len(places) else np.nan


def _blur(echoes: np.ndarray, sweep: np.ndarray, side: float) -> float:
    """Return how many times the blocks of `sweep` the same number of `echoes` fills, NaN for a sweep of no echo.

    echoes: (n, 2) m, of all sweeps as placed in the map, `sweep` (k, 2) among them. side: of a block, m. In each cell
    of a metre as many echoes are drawn as the sweep has there, so that only what lies elsewhere makes more blocks.
    """
    if not len(sweep):
        return np.nan
    generator, cells = np.random.default_rng(0), np.floor(echoes / _METRE)
    drawn = []
    for cell, count in zip(*np.unique(np.floor(sweep / _METRE), axis=0, return_counts=True)):
        here = echoes[(cells == cell).all(axis=1)]
        drawn += [generator.choice(here, count, replace=False) for _ in range(_DRAWS)]
    filled = sum(_cells(places, side) for places in drawn) / _DRAWS
    return filled / _cells(sweep, side)


def _row(name: str, mapped: MappedBag) -> str:
    """Return the row of a recording that was mapped."""
    blocks, run = mapped.run.stored.shown, mapped.run
    single = [_blocks_per_metre(scan.points[:, :2], blocks.resolution) for scan in mapped.replayed.scans]
    most = int(np.argmax([len(scan.points) for scan in mapped.replayed.scans]))
    solution, smeared = mapped.solution, np.nan
    if solution is not None:
        placed = [solution.heard(scan)[0][:, :2] for scan in mapped.replayed.scans]
        smeared = _blur(np.concatenate(placed), placed[most], blocks.resolution)
    wander = np.linalg.norm(run.best[:, :2] - run.best[0, :2], axis=1).max()
    sharp = _blocks_per_metre(blocks.mean[:, :2], blocks.resolution)
    return (
        f"{name:32} {len(single):5} {mapped.replayed.matched:7} {len(blocks):6} {sharp:9.2f} "
        f"{single[most]:7.2f} {smeared:5.2f} {wander:7.2f} {mapped.odometry.name:20} "
        f"{'' if mapped.findings is None else mapped.findings.trust.line}"
    )


def lines(folders: List[Path]) -> Iterator[str]:
    """Yield a row for each recording in folders, or why it has no map."""
    yield f"{'recording':32} scans matched blocks blocks/m  sweep  blur  wander odometry             trust"
    for path in recordings_in(folders):
        try:
            yield _row(path.name, mapped_as(read_recording(path, Request()), "--refine"))
        except (RecordingError, OSError) as error:
            yield f"{path.name:32} no map: {error}"
