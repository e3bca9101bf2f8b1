"""Prints how far the vehicle is from the truth where nothing is named but the recording.

Each row is mapped as `map_bag RECORDING --refine` maps it: no odometry, no parameter and no file is named. Distances
are means over the ends of the scans [m], live as known when the scan had been matched, and of the run refined
afterwards. NEES: squared error over stated variance, per axis; 1 is true. stated: median of the deviation that the run
gives for its positions [m]. shape: mean distance of the refined path once it is shifted, turned and scaled to fit best.
ms: of a core for a scan, median. With several seeds figures are means over them, and the odometry is the first one's.
"""

import re
from functools import partial
from typing import Callable, Dict, Iterator, List, NamedTuple, Sequence, Tuple

import numpy as np
from thesis_results.moves import moves_figures

from benchmarks.harness import benchmark_parser, mapped_as, marina
from benchmarks.paths import PathFigures, judged
from benchmarks.scans import KINDS, SonarKind
from benchmarks.tours import simulated
from benchmarks.twin_conditions import TWINS
from benchmarks.twin_water import twin_of
from mlsm_manager.offline.bag_mapping import MappedBag
from mlsm_manager.offline.recording import Recording
from mlsm_manager.offline.run_files import aligned_truth, positions_at
from mlsm_manager.scan_matching.scan import Track
from sonar_processing.beams.parameters import BeamCorrection

TOURS = ("harbour", "harbour_ahead", "basin", "basin_ahead")
_SOUND = 0.02  # relative deviation of ranges by the speed of sound: the prior's
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
_COLUMNS = ("live", "refined", "shape", "NEES", "refined", "stated", "refined", "ms", "odometry found")


class Row(NamedTuple):
    """made: from a seed to a recording with its truth. seeds: how many, at most. named: options of map_bag."""

    made: Callable[[int], Recording]
    seeds: int = 100
    named: Sequence[str] = ()


class Outcome(NamedTuple):
    """Of one run. odometry: what was found of it. milliseconds: of a core, median over the scans."""

    live: PathFigures
    refined: PathFigures
    odometry: str
    milliseconds: float


def rows() -> Dict[str, Row]:
    """Return all rows that are recordings, by their names."""
    return {
        "marina_first": Row(partial(_marina, np.ones(3)), 1),
        **{
            f"marina_first, positions x {s:g}": Row(partial(_marina, np.array([s, s, 1.0])), 1) for s in (0.7, 0.9, 1.3)
        },
        "marina_first, compass alone": Row(partial(_marina, np.array([0.0, 0.0, 1.0])), 1),
        **dict(_scaled_rows()),
        **{f"{tour}, {what}": Row(partial(_drawn, tour, _DRAWN[what])) for what in _DRAWN for tour in TOURS},
        **{f"{tour}, odometry stalls for 5 s": Row(partial(_stalled, tour)) for tour in TOURS},
        **{f"{tour}, compass alone": Row(partial(_compass, tour)) for tour in TOURS},
        **{f"{world}, {kind}": Row(partial(_head, world, kind)) for world in ("basin", "harbour") for kind in KINDS},
        **{f"twin {name}": Row(partial(_twin, name), 1) for name in TWINS},
    }


def _scaled_rows() -> Iterator[Tuple[str, Row]]:
    for what, error in (("30 % off", 0.3), ("1 % off", 0.01), ("exact", 0.0)):
        for tour in TOURS:
            row = Row(partial(_scaled, tour, error))
            yield f"{tour}, {what}", row
            if error < 0.3:
                yield f"{tour}, {what}, dvl named", row._replace(named=("--odometry", "dvl"))


def _marina(factors: np.ndarray, _seed: int) -> Recording:
    """Return the recording with an odometry that reports so many times (3,) its poses."""
    recording = marina(truth="/ground_truth")
    return recording.with_track(recording.track.with_poses(recording.track.poses * factors))


def _scaled(tour: str, error: float, seed: int) -> Recording:
    return simulated(f"{tour}_tour", seed=seed).scaled(error)


def _drawn(tour: str, errors: Dict[str, float], seed: int) -> Recording:
    """Return the recording with odometry, compass and speed of sound as wrong as their priors say, but for `errors`."""
    sound = np.random.RandomState(1000 + seed).normal(0.0, _SOUND)
    recording = simulated(f"{tour}_tour").with_dvl(seed, **errors)
    return recording.corrected(BeamCorrection(range_scale=1.0 / (1.0 + sound)))


def _stalled(tour: str, seed: int) -> Recording:
    """Return the recording of an odometry whose positions stand for some seconds, a quarter of the time."""
    recording = _drawn(tour, {}, seed)
    times, poses = recording.track.times, recording.track.poses.copy()
    changes = np.cumsum(np.random.RandomState(2000 + seed).exponential(np.tile(_GOES_AND_STANDS, len(times))))
    goes = np.searchsorted(changes, times[1:] - times[0]) % 2 == 0
    poses[1:, :2] = poses[0, :2] + np.cumsum(np.diff(poses[:, :2], axis=0) * goes[:, np.newaxis], axis=0)
    return recording.with_track(Track(times, poses))


def _head(world: str, kind: SonarKind, seed: int) -> Recording:
    return simulated(f"{world}_tour", kind).with_dvl(seed)


def _compass(tour: str, seed: int) -> Recording:
    return simulated(f"{tour}_tour").with_dvl(seed, direction=0.0).without_positions()


def _twin(name: str, _seed: int) -> Recording:
    return twin_of(marina(), TWINS[name])


def outcome(recording: Recording, named: Sequence[str]) -> Outcome:
    """Map a recording whose truth is known."""
    mapped = mapped_as(recording, "--refine", *named)
    found = mapped.replayed.rivals.told or mapped.odometry.kind.value
    milliseconds = 1e3 * float(np.median(mapped.replayed.seconds))
    return Outcome(_live(mapped, recording), _refined(mapped, recording), found, milliseconds)


def _live(mapped: MappedBag, recording: Recording) -> PathFigures:
    """Return the figures of what was known when each scan had been matched."""
    updates = mapped.replayed.updates
    times = np.array([update.scan.reference_time for update in updates])
    path = np.array([update.belief.theta[:2] for update in updates])
    stated = [update.belief if update.result is None else update.result for update in updates]
    return _judged(recording, times, path, np.array([one.covariance[:2, :2] for one in stated]))


def _refined(mapped: MappedBag, recording: Recording) -> PathFigures:
    """Return the figures of the run fitted at once; stated as map_bag states it, with other paths that are possible."""
    batch, solution = mapped.refined.batch, mapped.refined.solution
    path = solution.node_places(np.arange(len(batch.node_times)))
    stated = batch.pose_covariances[:, :2, :2] + mapped.refined.motion.spread(batch.node_times)
    return _judged(recording, batch.node_times[1:], path[1:], stated[1:])


def _judged(recording: Recording, times: np.ndarray, path: np.ndarray, covariances: np.ndarray) -> PathFigures:
    """Return the figures of a path (n, 2) at `times` (n,), against the truth aligned as map_bag aligns it."""
    truth, track = recording.truth, recording.track
    positions = positions_at(truth.times, aligned_truth(track.times, track.poses, truth), times)
    known = (times >= truth.times[0]) & (times <= truth.times[-1])
    return judged(path[known], positions[known], covariances[known])


def line(outcomes: Sequence[Outcome]) -> List[str]:
    """Return the cells of a row: means over its runs."""
    live, refined = (np.mean([one[path] for one in outcomes], axis=0) for path in (0, 1))
    live, refined = PathFigures(*live), PathFigures(*refined)
    numbers = (live.mean, refined.mean, refined.shape, live.nees, refined.nees, live.stated, refined.stated)
    return [
        *(f"{one:.2f}" for one in numbers),
        f"{np.mean([one.milliseconds for one in outcomes]):.0f}",
        outcomes[0].odometry,
    ]


def print_line(name: str, cells: Sequence[str]) -> None:
    """Print a line of the table."""
    print(name.ljust(48) + "".join(cell.ljust(9) for cell in cells), flush=True)


def main() -> None:
    """Print the table, line by line."""
    parser = benchmark_parser("no_parameters", __doc__)
    parser.add_argument(
        "--rows", default="^(?!twin|.*rays)", metavar="REGEX", help="which ones; default: all but twins and heads"
    )
    parser.add_argument("--seeds", type=int, default=4, help="of simulated rows (default: %(default)s)")
    parser.add_argument("--first", type=int, default=1, metavar="SEED", help="of these (default: %(default)s)")
    parser.add_argument("--odometry", metavar="NAME", help="as of map_bag; default: what each recording looks like")
    arguments = parser.parse_args()
    named = ("--odometry", arguments.odometry) if arguments.odometry else ()
    wanted = re.compile(arguments.rows)
    print_line("recording", _COLUMNS)
    for name, row in rows().items():
        if wanted.search(name):
            seeds = arguments.first + np.arange(min(row.seeds, arguments.seeds))
            print_line(name, line([outcome(row.made(int(seed)), row.named or named) for seed in seeds]))
    if wanted.search(_MOVES):
        print_line(_MOVES, moves_figures())
