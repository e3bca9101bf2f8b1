"""How a vehicle may go on that keeps its speed for a while, stops, starts anew and strafes, drawn at random."""

import numpy as np

from mlsm_manager.joint_solver.ways.way_echoes import WayEchoes
from mlsm_manager.joint_solver.ways.ways import HELD_SPEED, Draw, Ways

_CHANGE = 0.2  # chance that the speed jumps within a part of a turn: on average once in 27 s
_STOP = 0.4  # of these changes end at rest
_NEW_SPEED = 0.4  # m/s: deviation of a speed in each direction after a change
_WALK = 0.07  # m/s: by which a speed that is kept strays within a part
_ACCELERATE = 0.3  # share of the speeds that do not jump but change gradually,
_ACCELERATION = 0.35  # m/s: by so much within a part, as of a vehicle that takes ten seconds to start and to stop
_ROUGH = 0.05  # m: by which steps stray besides
_GUIDED = 0.25  # share of the ways that are led to where an echo that stands alone meets an earlier one
_FASTEST = 1.3  # m/s: of ways that are led
_LEAST_SHARE = 0.15  # of a part: an echo heard sooner tells too little of the speed


def drawn(ways: Ways, duration: float, turn: float, rng: np.random.RandomState) -> Draw:
    """Return where ways may be `duration` [s] later, when the heading has changed by `turn` [rad].

    A speed that is kept is kept in map by half of them, and in base_link by the others.
    """
    count = len(ways.nats)
    with_heading = rng.rand(count, 1) < 0.5
    strays = np.where(rng.rand(count, 1) < _ACCELERATE, _ACCELERATION, _WALK)
    kept = np.where(with_heading, _turned(ways.speeds, turn), ways.speeds) + strays * rng.normal(size=(count, 2))
    new = np.where(rng.rand(count, 1) < _STOP, HELD_SPEED, _NEW_SPEED) * rng.normal(size=(count, 2))
    changes, before = rng.rand(count, 1) < _CHANGE, duration * rng.rand(count, 1)
    speeds = np.where(changes, new, kept)
    steps = np.where(changes, before * ways.speeds + (duration - before) * new, duration / 2.0 * (ways.speeds + kept))
    return ways.paths[:, -1] + steps + _ROUGH * rng.normal(size=(count, 2)), speeds


def led(
    ways: Ways, draw: Draw, sources: WayEchoes, targets: WayEchoes, duration: float, rng: np.random.RandomState
) -> Draw:
    """Return `draw`, but for some ways that end where one of `sources` that stands alone meets one of `targets`.

    Ways drawn blindly hardly ever meet all echoes that stand alone, which tell the most where walls tell nothing.
    targets: their nodes count from the ways' first one. duration: s.
    """
    own, earlier = sources.selected(sources.lone), targets.selected(targets.lone)
    if not len(own) or not len(earlier):
        return draw
    some = np.flatnonzero(rng.rand(len(ways.nats)) < _GUIDED)
    chosen = rng.randint(len(own), size=len(some))
    at_rest = ways.paths[some, -1] + own.arms[chosen]
    shares = np.maximum(own.shares[chosen], _LEAST_SHARE)
    speeds = (earlier.places(ways.paths[some], 0) - at_rest[:, np.newaxis]) / (duration * shares)[:, None, None]
    possible = np.hypot(speeds[..., 0], speeds[..., 1]) < _FASTEST
    target = (rng.rand(*possible.shape) * possible).argmax(axis=1)
    led_ones = possible.any(axis=1)
    some, speeds = some[led_ones], speeds[np.arange(len(some)), target][led_ones]
    speeds = speeds + _ROUGH * rng.normal(size=speeds.shape)
    ends, new = draw
    ends[some], new[some] = ways.paths[some, -1] + duration * speeds, speeds
    return ends, new


def _turned(speeds: np.ndarray, turn: float) -> np.ndarray:
    cosine, sine = np.cos(turn), np.sin(turn)
    return speeds @ np.array([[cosine, sine], [-sine, cosine]])
