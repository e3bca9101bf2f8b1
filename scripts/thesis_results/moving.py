"""7.4: scans of a vehicle that never stops: 0.3 m/s, 2 deg/s, and an odometry whose velocity is 30 % wrong."""

from typing import List

import numpy as np
from benchmarks.harness import ROOT
from benchmarks.matchers import MatcherName
from benchmarks.scans import HEAD, KINDS, ScanMaker, still
from matplotlib.axes import Axes

from mlsm_manager.scan_matching.prediction import OdometryErrors
from mlsm_manager.scan_matching.scan import MatchResult, Scan, Track, corrected_points
from node_support.geometry import inverse, transformed, wrapped
from sonar_simulator.world.world_file import load_world
from thesis_results.moves import matching_estimator
from thesis_results.page import joined, prose, table
from thesis_results.pictures import Pictures, draw_outlines, new_figure, to_scale

SEEDS = 30
TURNS = 5
SPEED, TURN_RATE, WRONG = 0.3, np.radians(2.0), 0.7
_START = 16.0
_ERRORS = OdometryErrors(scale_deviation=0.3, turn_rate_deviation=0.01, rate_correlation_time=600.0)
_SHOWN_KIND = KINDS[0]
_BEFORE, _AFTER = "#d32f2f", "#2e7d32"


def make(pictures: Pictures) -> str:
    """Return the section."""
    maker = ScanMaker("basin", _SHOWN_KIND)
    runs = [moving_scans(maker, seed) for seed in range(SEEDS)]
    found = {name: [matches(scans, name) for scans in runs] for name in MatcherName}
    turned, seconds = np.degrees(TURN_RATE), HEAD.seconds_per_turn
    first = found[MatcherName.DISTRIBUTIONS][0]
    return joined(
        prose(f"""The thesis reports no figures for scans taken in motion. Here the vehicle runs on a circle at
        {SPEED:g} m/s and {turned:.0f} deg/s and never stops, while its odometry reports velocities that are {
            100.0 * (1.0 - WRONG):.0f} % too small. A turn of the head takes {seconds:g} s: the vehicle moves {
            SPEED * seconds:.1f} m and turns by {turned * seconds:.0f} degrees within a scan. {SEEDS} runs of {
            TURNS - 1
        } such
        scans, {_SHOWN_KIND}."""),
        _picture(pictures, runs[0], first),
        table(
            ["matcher", "accepted", "path, root mean square", "heading", "velocity"],
            [[f"`{name.value}`", *_summary(results)] for name, results in found.items()],
        ),
        prose("""Root mean squares over all beams of a run, and the median of the runs; of all matches where none
        was accepted. `DISTRIBUTIONS` finds pose and velocity together, `THESIS` moves the segments of a scan,
        `GICP` moves the scan as one piece."""),
    )


def _summary(runs: List[List[MatchResult]]) -> List[str]:
    accepted = sum(result.accepted for results in runs for result in results)
    chosen = [[result for result in results if result.accepted or not accepted] for results in runs]
    path, yaw, speed = np.median([root_mean_square(results) for results in chosen if results], axis=0)
    total = sum(map(len, runs))
    return [f"{accepted} of {total}", f"{path:.2f} m", f"{np.degrees(yaw):.2f} deg", f"{100.0 * speed:.1f} cm/s"]


def _picture(pictures: Pictures, scans: List[Scan], results: List[MatchResult]) -> str:
    world = load_world(ROOT / "worlds/basin.sdf").world
    scan, result = scans[-1], results[-1]
    places = {
        "as one piece, from the true last pose": _rigid(scan),
        "each beam where the match puts it": corrected_points(scan, result),
    }
    figure, (axes,) = new_figure(13.0, 6.6, 1, 2)
    for cell, (title, points), colour in zip(axes, places.items(), (_BEFORE, _AFTER)):
        draw_outlines(cell, world, "truth")
        cell.plot(*points[:, :2].T, ".", color=colour, markersize=3.0)
        _draw_paths(cell, scan, result)
        to_scale(cell, title, 30.0)
    axes[1].legend(loc="lower right", fontsize="small")
    return pictures.save(
        "moving_scan",
        figure,
        f"""Turn number {TURNS - 1} of the first run, over the true outlines. Left: as if the vehicle had stood still
        during the turn. Right: undistorted by the estimated path and velocity.""",
    )


def _rigid(scan: Scan) -> np.ndarray:
    """Return the points (n, 4) as they would be if all beams had been taken from the true pose at the end."""
    in_base = transformed(inverse(scan.track.at(scan.times)), scan.points)
    return transformed(true_path(np.array([scan.reference_time]))[0], in_base)


def _draw_paths(axes: Axes, scan: Scan, result: MatchResult) -> None:
    times = np.linspace(0.0, scan.reference_time, 200)
    axes.plot(*true_path(times)[:, :2].T, color="k", linewidth=3.0, alpha=0.3, label="true path")
    axes.plot(*odometry_path(times)[:, :2].T, color=_BEFORE, linewidth=1.0, label="odometry")
    axes.plot(*result.beam_poses[:, :2].T, color=_AFTER, linewidth=1.5, label="path of this scan, matched")


def circle(speed: float, turn_rate: float, times: np.ndarray) -> np.ndarray:
    """Return the poses (n, 3) of a vehicle that waits for one turn of the head and then runs on a circle."""
    seconds = np.maximum(times - _START, 0.0)
    yaw = turn_rate * seconds
    radius = speed / turn_rate
    return np.column_stack([radius * np.sin(yaw), radius * (1.0 - np.cos(yaw)), yaw])


def true_path(times: np.ndarray) -> np.ndarray:
    """Return the true poses (n, 3)."""
    return circle(SPEED, TURN_RATE, times)


def odometry_path(times: np.ndarray) -> np.ndarray:
    """Return the poses (n, 3) as the odometry has them."""
    return circle(SPEED * WRONG, TURN_RATE * WRONG, times)


def moving_scans(maker: ScanMaker, seed: int) -> List[Scan]:
    """Return a scan at rest and those of the circle."""
    times = np.linspace(-1.0, 16.0 * (TURNS + 1), 2400)
    track = Track(times, odometry_path(times))
    first = maker.scan(still(np.zeros(3)), still(np.zeros(3)), 100 * seed, 0, track=track)
    return [first] + [
        maker.scan(true_path, odometry_path, 100 * seed + turn, turn, moving=True, track=track)
        for turn in range(1, TURNS)
    ]


def matches(scans: List[Scan], name: MatcherName) -> List[MatchResult]:
    """Return what came of matching all scans but the first one, which makes the map."""
    estimator = matching_estimator(name, _ERRORS)
    estimator.add_scan(scans[0])
    return [estimator.add_scan(scan).result for scan in scans[1:]]


def squared_errors(result: MatchResult) -> np.ndarray:
    """Return (n, 3) squared errors of distance, yaw and speed at every beam of a matched scan."""
    difference = result.beam_poses - true_path(result.beam_times)
    speed = np.full(len(difference), np.hypot(*(result.velocity[:2] - [SPEED, 0.0])))
    return np.column_stack([(difference[:, :2] ** 2).sum(axis=1), wrapped(difference[:, 2]) ** 2, speed**2])


def root_mean_square(results: List[MatchResult]) -> np.ndarray:
    """Return (3,) root mean squares of the errors over all beams."""
    return np.sqrt(np.concatenate([squared_errors(result) for result in results]).mean(axis=0))
