"""7.4: scans of a vehicle that never stops: 0.3 m/s, 2 deg/s, and an odometry whose velocity is 30 % wrong."""

from functools import partial
from typing import Callable, List

import numpy as np
from benchmarks.matchers import MATCHERS
from benchmarks.scans import HEAD, KINDS, ScanMaker, still

from mlsm_manager.localisation.estimator import Estimator
from mlsm_manager.scan_matching.prediction import OdometryErrors
from mlsm_manager.scan_matching.scan import MatchResult, Scan, Track
from node_support.geometry import wrapped
from thesis_results.moves import THESIS_SEEDS, WORD, matching_estimator
from thesis_results.page import joined, prose, table
from thesis_results.pictures import Pictures
from thesis_results.thesis_scans import ThesisScans, thesis_estimator

SEEDS = 30
TURNS = 5
SPEED, TURN_RATE, WRONG = 0.3, np.radians(2.0), 0.7
_START = 16.0
# No compass: the heading is that of the odometry, and turns 30 % too little.
_ERRORS = OdometryErrors(
    scale_deviation=0.3, turn_rate_deviation=0.01, rate_correlation_time=600.0, heading_deviation=0.0
)


def make(_pictures: Pictures) -> str:
    """Return the section."""
    maker = ScanMaker("basin", KINDS[0])
    runs = [moving_scans(maker, seed) for seed in range(SEEDS)]
    estimators = {f"`{name}`": partial(matching_estimator, name, _ERRORS) for name in MATCHERS}
    found = {name: [matches(scans, estimator) for scans in runs] for name, estimator in estimators.items()}
    cleaned = ThesisScans(KINDS[0])
    found[WORD] = [matches(moving_scans(cleaned, seed), thesis_estimator) for seed in range(THESIS_SEEDS)]
    turned, wrong, seconds = np.degrees(TURN_RATE), 100.0 * (1.0 - WRONG), HEAD.seconds_per_turn
    moved = SPEED * seconds
    return joined(
        prose(f"""The thesis reports no figures for scans taken in motion. Here the vehicle runs on a circle at
        {SPEED:g} m/s and {turned:.0f} deg/s and never stops, while its odometry reports velocities that are
        {wrong:.0f} % too small. A turn of the head takes {seconds:g} s: the vehicle moves {moved:.1f} m and turns by
        {turned * seconds:.0f} degrees within a scan. {SEEDS} runs of {TURNS - 1} such scans, {KINDS[0]}
        ({THESIS_SEEDS} runs with {WORD})."""),
        table(
            ["matcher", "accepted", "path, root mean square", "heading", "velocity"],
            [[name, *_summary(results)] for name, results in found.items()],
        ),
        prose("""Root mean squares over all beams of a run, and the median of the runs; of all matches where none
        was accepted. `DISTRIBUTIONS` finds pose and velocity together, `THESIS` moves the segments of a scan,
        `GICP` moves the scan as one piece. The thesis turns still scans only, and here every one moves."""),
    )


def _summary(runs: List[List[MatchResult]]) -> List[str]:
    accepted = sum(result.accepted for results in runs for result in results)
    chosen = [[result for result in results if result.accepted or not accepted] for results in runs]
    path, yaw, speed = np.median([root_mean_square(results) for results in chosen if results], axis=0)
    total = sum(map(len, runs))
    return [f"{accepted} of {total}", f"{path:.2f} m", f"{np.degrees(yaw):.2f} deg", f"{100.0 * speed:.1f} cm/s"]


def path(times: np.ndarray, share: float = 1.0) -> np.ndarray:
    """Return poses (n, 3) of a vehicle that waits for one turn of the head and then runs on a circle.

    share: of speed and turn rate, WRONG for what the odometry says, 1 for the truth.
    """
    yaw, radius = share * TURN_RATE * np.maximum(times - _START, 0.0), SPEED / TURN_RATE
    return np.column_stack([radius * np.sin(yaw), radius * (1.0 - np.cos(yaw)), yaw])


def moving_scans(maker: ScanMaker, seed: int) -> List[Scan]:
    """Return a scan at rest and those of the circle."""
    times = np.linspace(-1.0, 16.0 * (TURNS + 1), 2400)
    odometry_path = partial(path, share=WRONG)
    track = Track(times, odometry_path(times))
    first = maker.scan(still(np.zeros(3)), still(np.zeros(3)), 100 * seed, 0, track=track)
    return [first] + [
        maker.scan(path, odometry_path, 100 * seed + turn, turn, moving=True, track=track) for turn in range(1, TURNS)
    ]


def matches(scans: List[Scan], make_estimator: Callable[[], Estimator]) -> List[MatchResult]:
    """Return what came of matching all scans but the first one, which makes the map."""
    estimator = make_estimator()
    estimator.add_scan(scans[0])
    return [estimator.add_scan(scan).result for scan in scans[1:]]


def root_mean_square(results: List[MatchResult]) -> np.ndarray:
    """Return (3,) root mean squares of the errors of distance, yaw and speed over all beams of matched scans."""
    squares = []
    for result in results:
        difference = result.beam_poses - path(result.beam_times)
        speed = np.full(len(difference), np.hypot(*(result.velocity[:2] - [SPEED, 0.0])))
        squares.append(
            np.column_stack([(difference[:, :2] ** 2).sum(axis=1), wrapped(difference[:, 2]) ** 2, speed**2])
        )
    return np.sqrt(np.concatenate(squares).mean(axis=0))
