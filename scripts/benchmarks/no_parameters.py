"""How far the vehicle is from the truth where nothing is named but the recording.

Each row is mapped as `map_bag RECORDING --refine` maps it: no odometry, no parameter and no file is named. Distances
are means over the ends of the scans [m], live as known when the scan had been matched, and of the run refined
afterwards. NEES: squared error over stated variance, per axis; 1 is true. stated: median of the deviation that the run
gives for its positions [m]. shape: mean distance of the refined path once it is shifted, turned and scaled to fit best.
ms: of a core for a scan, median. With several seeds figures are means over them, and the odometry is the first one's.
"""

import re
from functools import partial
from itertools import product
from typing import Callable, Dict, Iterator, List, Sequence, Tuple

import numpy as np
from thesis_results.moves import SEEDS, session_scans, session_track, true_path, wanted

from benchmarks.harness import mapped_as, marina
from benchmarks.paths import PathFigures, judged
from benchmarks.scans import KINDS, ScanMaker, SonarKind
from benchmarks.tours import HEAD, simulated
from benchmarks.twin_conditions import TWINS
from benchmarks.twin_water import twin_of
from mlsm_manager.offline.map_bag import map_bag_arguments
from mlsm_manager.offline.recording import Recording
from mlsm_manager.offline.run_files import aligned_truth, positions_at
from mlsm_manager.scan_matching.scan import Track
from sonar_processing.beams.parameters import BeamCorrection

_TOURS = ("harbour", "harbour_ahead", "basin", "basin_ahead")
_SOUND = 0.02  # relative deviation of ranges by the speed of sound: the prior's
_SCALED = {"30 % off": 0.3, "1 % off": 0.01, "exact": 0.0}
_DRAWN = {
    "30 % off, all errors drawn": {"scale": 0.3},
    "1 % off, all errors drawn": {},
    "scale walks 10 % in 10 min": {"scale_walk": 0.1 / np.sqrt(600.0)},
    "current of 0.1 m/s": {"current": 0.1},
    "compass 2 deg off and drifting": {"heading_deviation": 0.035, "heading_walk": 0.001},
}
"""What is wrong with an odometry of DVL and compass besides its usual errors; of these rows NEES should be 1."""
_GOES_AND_STANDS = (15.0, 5.0)  # s, mean durations
_MOVES = "thesis's three moves, 30 % off"
_CORRECTED = 0.5  # share of the odometry's error
_COLUMNS = ("live", "refined", "shape", "NEES", "refined", "stated", "refined", "ms", "odometry found")


def _rows() -> Dict[str, Callable[[int], Recording]]:
    """Return what makes each recording, with its truth, from a seed."""
    return {
        **{f"{tour}, {what}": partial(_scaled, tour, _SCALED[what]) for what, tour in product(_SCALED, _TOURS)},
        **{f"{tour}, {what}": partial(_drawn, tour, _DRAWN[what]) for what, tour in product(_DRAWN, _TOURS)},
        **{f"{tour}, odometry stalls for 5 s": partial(_stalled, tour) for tour in _TOURS},
        **{f"{tour}, compass alone": partial(_compass, tour) for tour in _TOURS},
        **{f"{tour}, {kind}": partial(_usual, tour, kind) for tour, kind in product(("basin", "harbour"), KINDS)},
        **{f"twin {name}": lambda _, twin=twin: twin_of(marina(), twin) for name, twin in TWINS.items()},
    }


def _scaled(tour: str, error: float, seed: int) -> Recording:
    return simulated(f"{tour}_tour", seed=seed).scaled(error)


def _usual(tour: str, kind: SonarKind, seed: int, **errors: float) -> Recording:
    return simulated(f"{tour}_tour", kind).with_dvl(seed, **errors)


def _drawn(tour: str, errors: Dict[str, float], seed: int) -> Recording:
    """Return the recording with odometry, compass and speed of sound as wrong as their priors say, but for `errors`."""
    sound = np.random.RandomState(1000 + seed).normal(0.0, _SOUND)
    return _usual(tour, HEAD, seed, **errors).corrected(BeamCorrection(range_scale=1.0 / (1.0 + sound)))


def _stalled(tour: str, seed: int) -> Recording:
    """Return the recording of an odometry whose positions stand for some seconds, a quarter of the time."""
    recording = _drawn(tour, {}, seed)
    times, poses = recording.track.times, recording.track.poses.copy()
    changes = np.cumsum(np.random.RandomState(2000 + seed).exponential(np.tile(_GOES_AND_STANDS, len(times))))
    goes = np.searchsorted(changes, times[1:] - times[0]) % 2 == 0
    poses[1:, :2] = poses[0, :2] + np.cumsum(np.diff(poses[:, :2], axis=0) * goes[:, np.newaxis], axis=0)
    return recording.with_track(Track(times, poses))


def _compass(tour: str, seed: int) -> Recording:
    return _usual(tour, HEAD, seed, direction=0.0).without_positions()


def _outcome(recording: Recording, named: Sequence[str]) -> Tuple[List[float], str]:
    """Map a recording whose truth is known; return the numbers of its row, and what was found of its odometry."""
    mapped = mapped_as(recording, "--refine", *named)
    updates, batch = mapped.replayed.updates, mapped.refined.motion.fit
    path = np.array([update.belief.theta[:2] for update in updates])
    stated = [update.belief if update.result is None else update.result for update in updates]
    live = _judged(
        recording, np.array([update.scan.reference_time for update in updates]), path,
        np.array([one.covariance[:2, :2] for one in stated]),
    )  # fmt: skip
    # As map_bag states it, with other paths that are possible.
    covariances = batch.pose_covariances[:, :2, :2] + mapped.refined.motion.spread(batch.node_times)
    path = mapped.refined.motion.run.node_places(np.arange(len(batch.node_times)))
    refined = _judged(recording, batch.node_times[1:], path[1:], covariances[1:])
    milliseconds = 1e3 * float(np.median(mapped.replayed.seconds))
    numbers = [
        live.mean, refined.mean, refined.shape, live.nees, refined.nees, live.stated, refined.stated, milliseconds
    ]  # fmt: skip
    return numbers, mapped.replayed.rivals.told or mapped.odometry.kind.value


def _judged(recording: Recording, times: np.ndarray, path: np.ndarray, covariances: np.ndarray) -> PathFigures:
    """Return the figures of a path (n, 2) at `times` (n,), against the truth aligned as map_bag aligns it."""
    truth, track = recording.truth, recording.track
    positions = positions_at(truth.times, aligned_truth(track.times, track.poses, truth), times)
    known = (times >= truth.times[0]) & (times <= truth.times[-1])
    return judged(path[known], positions[known], covariances[known])


def _moves_corrected() -> str:
    """Return of how many runs each position from the second scan on is at least twice as near as the odometry's."""
    maker, track, corrected = ScanMaker("basin", KINDS[0]), session_track(), 0
    parameters = map_bag_arguments(["recording", "--out", "nowhere"]).parameters
    for seed in range(SEEDS):
        localiser, off = parameters.build_localiser(), []
        for scan in session_scans(maker, seed, track):
            place = localiser.take_scan(scan).scan.belief.theta[:2]
            off.append([place - true_path(np.array([scan.reference_time]))[0, :2], wanted(scan)])
        found, odometry = np.linalg.norm(off, axis=-1)[1:].T
        corrected += bool((found < _CORRECTED * odometry).all())
    return f"{corrected} of {SEEDS} corrected from the second scan on"


def lines(rows: str = "^(?!twin|.*rays)", seeds: int = 4, first: int = 1, odometry: str = "") -> Iterator[str]:
    """Yield the rows that a regular expression finds, by default all but twins and heads.

    seeds: of simulated rows, from the first on. odometry: as of map_bag; empty: what each recording looks like.
    """
    named = ("--odometry", odometry) if odometry else ()
    yield _line("recording", _COLUMNS)
    for name, made in _rows().items():
        if re.search(rows, name):
            count = 1 if name.startswith("twin") else seeds
            outcomes = [_outcome(made(seed), named) for seed in range(first, first + count)]
            *means, milliseconds = np.mean([numbers for numbers, _ in outcomes], axis=0)
            yield _line(name, [*(f"{one:.2f}" for one in means), f"{milliseconds:.0f}", outcomes[0][1]])
    if re.search(rows, _MOVES):
        yield _line(_MOVES, [_moves_corrected()])


def _line(name: str, cells: Sequence[str]) -> str:
    return name.ljust(48) + "".join(cell.ljust(9) for cell in cells)
