"""Simulated heads that stand, drift or move, with nothing but their beams: what their sweeps tell, and the map's error.

Tank, basin and harbour; full turns and sectors of 40 to 180 degrees, to and fro; 3 to 30 sweeps; each by its own seed.
With --map each recording is mapped too. Its errors are those at the ends of sweeps, over their stated deviations, where
anything is said of the position; the blind side is the direction in which the statement is widest.
"""

import re
from typing import Iterator, List, NamedTuple, Optional, Tuple

import numpy as np

from benchmarks.harness import ROOT, mapped_as
from benchmarks.scans import DEPTH, RAYS
from mlsm_manager.offline.recording import Recording
from mlsm_manager.offline.run_files import positions_at
from mlsm_manager.scan_matching.scan import Track
from node_support.geometry import matrices, wrapped
from recordings.motion.sweep_shifts import SweepMotion, sweep_shifts
from sonar_processing.beams.beam import Beam, PlacedBeam
from sonar_simulator.echoes.echo_model import make_echo_model
from sonar_simulator.echoes.ray_caster import RayCaster
from sonar_simulator.simulation.sonar_head import Sonar, SonarParameters
from sonar_simulator.world.world_file import load_world

_START, _BEAM_SECONDS = 1000.0, 0.06  # s; a Ping360 at 40 m
_STEP, _STEPS = np.radians(1.8), 200
_SWEEPS = (3, 4, 6, 10, 16, 30)
_SECTORS = (40, 60, 90, 120, 180, 360)  # degrees
_FISH, _FISH_SPEED, _FISH_STRENGTH = 8, 0.3, 140.0  # number, m/s, of 255
_WITHIN = 1.96  # deviations that hold 95 %
_BUBBLES = 0.02  # share of beams with a cloud of them


class _Water(NamedTuple):
    """Range of the head [m], where it begins [m], and how far from there it is put by chance [m]."""

    reach: float
    start: np.ndarray
    around: float


_WATERS = {
    "tank": _Water(10.0, np.array([0.0, 0.6]), 1.0),
    "basin": _Water(50.0, np.array([10.0, 5.0]), 8.0),
    "harbour": _Water(40.0, np.array([3.0, 8.0]), 3.0),
}
_MOTIONS = ("still", "still, fish", "drifting", "moving")


def _simulated_head(motion: str, seed: int, sector: Optional[int]) -> Tuple[Recording, Track]:
    """Return what a log of a head tells, beams and no motion, and its true path. sector: degrees, if given.

    The seed draws water, place and sweeps.
    """
    rng = np.random.default_rng([seed, _MOTIONS.index(motion)])
    name = list(_WATERS)[seed % len(_WATERS)]
    water = _WATERS[name]
    angles = _angles(sector or int(rng.choice(_SECTORS)), int(rng.choice(_SWEEPS)), rng)
    times = _START + _BEAM_SECONDS * np.arange(len(angles))
    path = _path(motion, times, water, rng)
    model = make_echo_model("laser_cone", {"max_range": water.reach, "spread": 0.004 * water.reach, "bins": 600})
    rows, columns = RAYS[45]
    pattern = SonarParameters(ray_rows=rows, ray_columns=columns).pattern()
    sonar = Sonar(RayCaster(load_world(ROOT / f"worlds/{name}.sdf")), pattern, model, rng)
    places = matrices(path.poses)
    places[:, 2, 3] = DEPTH if name != "tank" else -1.2
    strengths = sonar.pings(places, angles).astype(np.float64) * rng.gamma(4.0, 0.25, (len(angles), 1))
    strengths += rng.exponential(6.0, strengths.shape)
    if "fish" in motion:
        _add_fish(strengths, path, angles, water, rng)
    echoes = np.minimum(strengths, 255.0).astype(np.uint8)
    beams = [
        PlacedBeam(Beam(round(1e9 * time), "sonar", float(angle), one, sonar.range_resolution), np.eye(4), False)
        for time, angle, one in zip(times, angles, echoes)
    ]
    return Recording(beams, 0, Track(times, np.zeros((len(times), 3))), None), path


def _angles(sector: int, sweeps: int, rng: np.random.Generator) -> np.ndarray:
    if sector == 360:
        return wrapped(_STEP * np.arange(_STEPS * min(sweeps, 10)))
    half = round(np.radians(sector) / _STEP / 2.0)
    forth = np.arange(-half, half + 1)
    return wrapped(
        rng.uniform(-np.pi, np.pi) + _STEP * np.concatenate([forth[:: 1 - 2 * (n % 2)] for n in range(sweeps)])
    )


def _path(motion: str, times: np.ndarray, water: _Water, rng: np.random.Generator) -> Track:
    """Return where a head is: at one place, swinging by some cm/s, or on its way at 0.15 to 0.4 m/s."""
    start = np.append(water.start + rng.uniform(-water.around, water.around, 2), rng.uniform(-np.pi, np.pi))
    seconds = times - times[0]
    poses = np.tile(start, (len(times), 1))
    direction = rng.uniform(-np.pi, np.pi)
    ahead = np.array([np.cos(direction), np.sin(direction)])
    if motion == "drifting":
        swing = rng.uniform(0.3, 0.8) * water.around
        poses[:, :2] += np.outer(swing * np.sin(rng.uniform(0.03, 0.06) * seconds / swing), ahead)
        poses[:, 2] += np.radians(4.0) * np.sin(seconds / rng.uniform(10.0, 40.0))
    if motion == "moving":
        speed = rng.uniform(0.15, 0.4) * (0.5 if water.reach < 20.0 else 1.0)
        length = 2.0 * water.around
        poses[:, :2] += np.outer(length * np.sin(speed * seconds / length), ahead)
    return Track(times, poses)


def _add_fish(strengths: np.ndarray, path: Track, angles: np.ndarray, water: _Water, rng: np.random.Generator) -> None:
    """Add echoes of fish that swim about, and clouds of bubbles, to strengths (beams, bins)."""
    bins = strengths.shape[1]
    seconds, length = path.times - path.times[0], water.reach / bins
    for _ in range(_FISH):
        place = rng.uniform(-0.5, 0.5, 2) * water.reach
        velocity = rng.normal(0.0, _FISH_SPEED, 2)
        offsets = place + np.outer(seconds, velocity)
        ranges, bearings = np.hypot(*offsets.T), np.arctan2(offsets[:, 1], offsets[:, 0]) - path.poses[:, 2]
        for beam in np.flatnonzero((np.abs(wrapped(bearings - angles)) < _STEP) & (ranges < water.reach - 1.0)):
            first = int(ranges[beam] / length)
            strengths[beam, first : first + 6] += rng.exponential(_FISH_STRENGTH)
    for beam in np.flatnonzero(rng.uniform(size=len(angles)) < _BUBBLES):
        first = int(rng.integers(0, bins // 2))
        strengths[beam, first : first + 40] += rng.exponential(60.0)


def _errors(head: Recording, path: Track) -> List[float]:
    """Map a head and return its errors at the ends of sweeps, without the first one, where the map begins.

    How far the position is from where it began, at most [m]; how far the path told wanders [m]; where a position is
    told: mean of the squared error over what is stated, 1 if that is true, the same of the widest direction, and the
    share of errors in that direction within what is stated with 95 %; else NaN.
    """
    mapped = mapped_as(head, "--refine")
    run, trust = mapped.run, mapped.findings.trust
    start = path.poses[0]
    turn = np.array([[np.cos(start[2]), -np.sin(start[2])], [np.sin(start[2]), np.cos(start[2])]])
    true = (path.poses[:, :2] - start[:2]) @ turn
    errors = (positions_at(run.times, run.best, trust.times) - positions_at(path.times, true, trust.times))[1:]
    stated, sides = np.linalg.eigh(trust.covariances[1:])
    squares = np.einsum("ni,nij->nj", errors, sides) ** 2 / stated
    wander = np.hypot(*(run.best[:, :2] - run.best[0, :2]).T).max()
    told = np.nan if trust.uncertainty is None else 1.0
    of_stated = np.array([squares.mean(), squares[:, 1].mean(), np.mean(squares[:, 1] <= _WITHIN**2)])
    return [np.hypot(*errors.T).max(), wander, *(told * of_stated)]


def lines(
    rows: str = ".", count: int = 30, first_seed: int = 0, sector: Optional[int] = None, map_: bool = False
) -> Iterator[str]:  # fmt: skip
    """Yield for each motion that a regular expression finds how many heads were called what.

    count: heads of each motion. first_seed: others than the published ones. sector: degrees; by default drawn. map:
    map each head too, and print the errors.
    """
    names = [motion.value for motion in SweepMotion]
    yield f"{'motion':14}" + "".join(f"{name:>10}" for name in names)
    for motion in (one for one in _MOTIONS if re.search(rows, one)):
        heads = [_simulated_head(motion, seed, sector) for seed in range(first_seed, first_seed + count)]
        called = [sweep_shifts(head.sent).motion.value for head, _ in heads]
        yield f"{motion:14}" + "".join(f"{called.count(name):10}" for name in names)
        for name in sorted(set(called)) if map_ else []:
            yield _error_line(name, np.array([_errors(*head) for head, one in zip(heads, called) if one == name]))


def _error_line(name: str, found: np.ndarray) -> str:
    """Return the errors (heads, 5) of those that were called so."""
    (far, wander), (most, farthest) = (statistic(found[:, :2], axis=0) for statistic in (np.median, np.max))
    of_stated = found[np.isfinite(found[:, 2]), 2:]
    squared, blind, covered = of_stated.mean(axis=0) if len(of_stated) else np.full(3, np.nan)
    return (
        f"    called {name:9} error {far:.2f} m median, {most:.2f} m at most; wander {wander:.2f}, {farthest:.2f} m at "
        f"most; position told of {len(of_stated)}: squared error over stated {squared:.2f}, blind side {blind:.2f}, "
        f"{covered:.0%} of it covered"
    )
