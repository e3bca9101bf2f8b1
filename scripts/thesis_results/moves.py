"""7.4: the thesis's three moves, with an odometry that is 30 % off."""

from dataclasses import dataclass
from functools import partial
from itertools import product
from typing import Callable, Dict, Iterator, List, Sequence

import numpy as np
import yaml
from benchmarks.harness import ROOT
from benchmarks.matchers import DISTRIBUTIONS, MATCHERS
from benchmarks.scans import HEAD, KINDS, ScanMaker, still
from matplotlib.axes import Axes

from mlsm_manager.localisation.estimator import Estimator
from mlsm_manager.localisation.keyframe_map import MapSettings
from mlsm_manager.localisation.thesis_estimator import ThesisEstimator
from mlsm_manager.scan_matching.prediction import OdometryErrors
from mlsm_manager.scan_matching.scan import MatchResult, Scan, Track, corrected_points
from mlsm_manager.surface_map.blocks import Blocks
from sonar_simulator.simulation.scripted_vehicle import VehicleScript
from sonar_simulator.world.world import World
from sonar_simulator.world.world_file import load_world
from thesis_results.page import joined, prose, table
from thesis_results.pictures import Pictures, draw_from_above, draw_outlines, new_figure, to_scale
from thesis_results.thesis_scans import ThesisScans, fine_estimator, thesis_estimator

SEEDS = 30
TURNS = 7
_SETTINGS = MapSettings(0.5, 0.5, 1e4, 1000)
ODOMETRY = OdometryErrors(scale_deviation=0.3)
_SCALE = 1.3
_SCRIPT = yaml.safe_load((ROOT / "yaml/thesis_moves.yaml").read_text())
_VEHICLE = VehicleScript.from_yaml_data(_SCRIPT["moves"], _SCRIPT["start"])
MOVES = ("4 m on x", "4 m on x and 3 m on y", "then -8 m on x")
"""As the odometry sees them."""
PUBLISHED = ((1.348, 0.001, 0.313), (0.851, 0.781, 0.188), (-1.197, 0.618, 0.025))
"""The corrections, x and y, and errors [m] of figures 7.7 to 7.9 of the thesis."""
THESIS_SEEDS = 10
"""Runs with thesis:=true, whose scans have a hundred times as many points."""
WORD = "`thesis:=true`"
_DISPLACED = np.array([0.3, -0.2, np.radians(5.0)])
"""x y [m] and yaw by which a still scan is put beside its place."""
AT_REST = (2, 4, 6)
"""Turns of the head during which the vehicle rests after each move."""
_SHARP, _THESIS = KINDS[0], KINDS[2]
_REACH = 29.0  # m: both long walls and the gate are in the picture
_BEFORE, _AFTER = "#d32f2f", "#2e7d32"
_GATE = (9.0, 15.0), (-1.7, 1.7)  # m, what the inset shows


@dataclass(frozen=True)
class Fix:
    """One match after a move, and the map that the scan was matched with."""

    scan: Scan
    result: MatchResult
    target: Blocks

    @property
    def correction(self) -> np.ndarray:
        """(3,) T_map_odom that the matcher found, accepted or not."""
        return self.scan.correction_to(self.result.pose)


def wanted(scan: Scan) -> np.ndarray:
    """Return the correction (2,) m that would be right: from where the odometry is to where the vehicle is."""
    time = np.array([scan.reference_time])
    return (true_path(time) - odometry_path(time))[0, :2]


def fixes(scans: Sequence[Scan], estimator: Estimator) -> List[Fix]:
    """Return the matches after each of the moves."""
    found = []
    for turn, scan in enumerate(scans):
        target = estimator.matched.blocks
        update = estimator.add_scan(scan)
        if turn in AT_REST:
            found.append(Fix(scan, update.result, target))
    return found


def make(pictures: Pictures) -> str:
    """Return the section."""
    track, sessions = session_track(), {}
    for kind in (_SHARP, _THESIS):
        maker = ScanMaker("basin", kind)
        sessions[kind] = [session_scans(maker, seed, track) for seed in range(SEEDS)]
    makers = {kind: ThesisScans(kind) for kind in sessions}
    by_chain = {
        kind: [session_scans(maker, seed, track) for seed in range(THESIS_SEEDS)] for kind, maker in makers.items()
    }
    found = {f"`{one}`": fixes(sessions[_SHARP][0], matching_estimator(one, ODOMETRY)) for one in MATCHERS}
    found[WORD] = fixes(by_chain[_THESIS][0], thesis_estimator())
    return joined(
        prose("""The vehicle makes the moves of the thesis in the basin: 4 m on x, 3 m on y and -8 m on x as the
        odometry sees them, and 30 % more in truth. After each move the vehicle rests for a scan, which is
        matched with the map of the scans before. `DISTRIBUTIONS` is what finds a scan in a map, `THESIS` the
        thesis's own matcher without the faults of its code, `GICP` Open3D's; all three get the same echoes.
        `thesis:=true` matches cleaned clouds of a pulse of 1 m, as the thesis did. The thesis published one
        run."""),
        _picture(pictures, found[f"`{DISTRIBUTIONS}`"]),
        "Corrections of one run, x and y in metres, how far they are from the wanted ones, and the matcher's error:",
        table(["move", "wanted", "thesis", *found], _corrections(found)),
        prose(f"""All scans after the first one, also those taken during the moves, of {SEEDS} runs with other
        noise ({THESIS_SEEDS} runs with `thesis:=true`): how many were accepted, and how far the positions were off,
        median and 95 % (of all matches where none was accepted):"""),
        table(
            ["", *(f"`{name}`" for name in MATCHERS), WORD],
            [
                [
                    str(kind), *(_summary(runs, partial(matching_estimator, name, ODOMETRY)) for name in MATCHERS),
                    _summary(by_chain[kind], thesis_estimator),
                ]
                for kind, runs in sessions.items()
            ],
        ),
        prose(f"""The static matching of the thesis (6.5.6): a still scan that is put beside its place by 0.3 m on
        x, -0.2 m on y and 5 degrees is matched with the map of another one. Median and greatest of {THESIS_SEEDS} runs;
        the thesis gives no number ("the expected results", 7.4):"""),
        table(["", "", "off by", "heading", "error"], list(_static_rows())),
    )  # fmt: skip


def displaced_fix(maker: ScanMaker, estimator: Estimator, seed: int) -> MatchResult:
    """Return the match of a still scan at the origin, put beside its place, with the map of another one."""
    turn, here = HEAD.seconds_per_turn, still(np.zeros(3))
    beside = np.stack([np.zeros(3), np.zeros(3), _DISPLACED, _DISPLACED])
    track = Track(turn * np.array([-1.0, 0.9999, 1.0, 3.0]), beside)
    estimator.add_scan(maker.scan(here, here, 2 * seed, track=track))
    return estimator.add_scan(maker.scan(here, still(_DISPLACED), 2 * seed + 1, 1, track=track)).result


def _static_rows() -> Iterator[List[str]]:
    estimators = {WORD: thesis_estimator, f"{WORD} with cells of 0.3 m, the code's default": fine_estimator}
    for kind, (name, make_estimator) in product((_SHARP, _THESIS), estimators.items()):
        maker = ThesisScans(kind)
        results = [displaced_fix(maker, make_estimator(), seed) for seed in range(THESIS_SEEDS)]
        found = [[np.hypot(*one.pose[:2]), abs(np.degrees(one.pose[2])), one.error] for one in results]
        (distance, yaw, error), (most, most_yaw, _) = np.median(found, axis=0), np.max(found, axis=0)
        yield [
            str(kind), name, f"{distance:.2f} m, {most:.2f} m", f"{yaw:.2f} deg, {most_yaw:.2f} deg", f"{error:.2f} m"
        ]  # fmt: skip


def _corrections(found: Dict[str, List[Fix]]) -> List[List[str]]:
    rows = []
    for number, move in enumerate(MOVES):
        fixed = [one[number] for one in found.values()]
        right = wanted(fixed[0].scan)
        cells = [_cell(one.correction[:2], right, one.result.error, one.result.accepted) for one in fixed]
        *published, error = PUBLISHED[number]
        rows.append([move, f"{right[0]:.2f}, {right[1]:.2f}", _cell(np.array(published), right, error, True), *cells])
    return rows


def _cell(correction: np.ndarray, right: np.ndarray, error: float, accepted: bool) -> str:
    off = np.hypot(*(correction - right))
    found = f"{correction[0]:.2f}, {correction[1]:.2f}: {off:.2f} m off, error {error:.2f} m"
    return found + ("" if accepted else ", rejected")


def _summary(runs: List[List[Scan]], make_estimator: Callable[[], Estimator]) -> str:
    errors = np.concatenate([session_errors(scans, make_estimator()) for scans in runs])
    accepted = errors[errors[:, 0] > 0]
    median, most = np.quantile((accepted if len(accepted) else errors)[:, 1], [0.5, 0.95])
    return f"{len(accepted)} of {len(errors)}; {median:.2f} m, {most:.2f} m"


def _picture(pictures: Pictures, found: List[Fix]) -> str:
    world = load_world(ROOT / "worlds/basin.sdf")
    figure, (axes,) = new_figure(18.0, 6.5, 1, len(MOVES))
    for cell, fix, move in zip(axes, found, MOVES):
        _draw_fix(cell, fix, world, move)
    axes[0].legend(loc="upper left", fontsize="small", markerscale=3.0)
    return pictures.save(
        "three_moves",
        figure,
        """The map before each scan (red cells), the echoes of the scan where the odometry puts them and where the match
        puts them, and the true outlines (blue). Compare with figures 7.7 to 7.9 of the thesis.""",
    )


def _draw_fix(axes: Axes, fix: Fix, world: World, move: str) -> None:
    gate = axes.inset_axes((0.55, 0.18, 0.44, 0.24))
    for part, size in ((axes, 3.0), (gate, 7.0)):
        _draw_echoes(part, fix, world, size)
    x, y = fix.correction[:2]
    title = f"{move}: correction {x:.3f}, {y:.3f} m; residual {fix.result.error:.3f} m"
    to_scale(axes, title, _REACH, (fix.result.pose[0], 0.0))
    gate.set(aspect="equal", title="the gate", xlim=_GATE[0], ylim=_GATE[1], xticks=[], yticks=[])


def _draw_echoes(axes: Axes, fix: Fix, world: World, size: float) -> None:
    draw_outlines(axes, world, "truth")
    draw_from_above(axes, fix.target, alpha=0.5)
    matched = corrected_points(fix.scan, fix.result)
    axes.plot(*fix.scan.points[:, :2].T, ".", color=_BEFORE, markersize=size, label="as by the odometry")
    axes.plot(*matched[:, :2].T, ".", color=_AFTER, markersize=size, label="as matched")


def true_path(times: np.ndarray) -> np.ndarray:
    """Return the true planar poses (n, 3) of the thesis's moves."""
    return np.array([[pose[0, 3], pose[1, 3], 0.0] for pose in map(_VEHICLE.pose, times)])


def odometry_path(times: np.ndarray) -> np.ndarray:
    """Return the poses (n, 3) as odometry of 30 % error has them."""
    return true_path(times) / [_SCALE, _SCALE, 1.0]


def session_track() -> Track:
    """Return the odometry of the moves."""
    times = np.linspace(-1.0, _VEHICLE.duration, 2400)
    return Track(times, odometry_path(times))


def session_scans(maker: ScanMaker, seed: int, track: Track) -> List[Scan]:
    """Return one scan per turn of the head; every second one sees a whole move."""
    return [
        maker.scan(true_path, odometry_path, 100 * seed + turn, turn, moving=bool(turn % 2), track=track)
        for turn in range(TURNS)
    ]


def matching_estimator(name: str, errors: OdometryErrors) -> ThesisEstimator:
    """Return an estimator that matches with default parameters and knows how wrong the odometry may be."""
    estimator = ThesisEstimator(_SETTINGS, errors, MATCHERS[name]())
    estimator.matching = True
    return estimator


def session_errors(scans: List[Scan], estimator: Estimator) -> np.ndarray:
    """Return (scans - 1, 4): accepted, distance [m] and angle [rad] from the truth, squared Mahalanobis distance.

    Where a match was not accepted, the pose is the one that the matcher offered.
    """
    rows = []
    for scan in scans:
        update = estimator.add_scan(scan)
        if update.result is None:
            continue
        difference = update.result.pose - true_path(np.array([scan.reference_time]))[0]
        squared = difference @ np.linalg.solve(update.belief.covariance[:3, :3], difference)
        rows.append([update.accepted, np.hypot(*difference[:2]), abs(difference[2]), squared])
    return np.array(rows)
