"""Checks of path, odometry and calibration: against each other, other solutions, and what was expected."""

from typing import Optional, Sequence, Tuple

import numpy as np

from mlsm_manager.joint_solver.rival_solvers import Doubt
from mlsm_manager.self_check.verdict import Verdict, merged, percent

_WINDOW, _STEP = 350.0, 14.0  # s: about 25 scans, and between windows about one turn of a head
_LIMIT = 4.0  # standard deviations of the odometry
_SPREAD_LIMIT, _APART_LIMIT = 2.0, 3.0  # standard deviations of the path, and of a calibration
_SHORTEST = 15.0  # m that the vehicle must have gone in a window, so that a ratio means something
_HEADING_SPREAD = 0.05  # rad by which the direction of motion may differ along a run: compass and mounting
_NOWHERE = np.empty((0, 2))
_LEAST_DOUBT = 1.0  # m: less does not matter to a map
LARGEST_DEVIATION = 5.0  # m, above which a position is not known, see position_uncertainty


def against_odometry(
    times: np.ndarray,
    odometry: np.ndarray,
    corrected: np.ndarray,
    scale_deviation: float = 0.01,
    position_walk: float = 0.12,
) -> Tuple[Verdict, Verdict]:
    """Return verdicts on the distances along and across the odometry's, in standard deviations of the odometry.

    A matcher that is dragged along a featureless canal finds a path that is too short, and is sure of every step. The
    odometry's scale is known far better than that.

    times: (m,) s. odometry, corrected: (m, >= 2) positions. scale_deviation and position_walk [m/sqrt(s)]: of the
    odometry.
    """
    starts = np.arange(times[0], times[-1] - _WINDOW, _STEP)
    paths = (path[:, 0] + 1j * path[:, 1] for path in (odometry, corrected))
    moves = [np.interp(starts + _WINDOW, times, path) - np.interp(starts, times, path) for path in paths]
    far = np.abs(moves[0]) > _SHORTEST
    starts, by_odometry, ratio = starts[far], moves[0][far], moves[1][far] / moves[0][far]
    walk = position_walk**2 * _WINDOW / np.abs(by_odometry) ** 2
    longer = np.abs(ratio) - 1.0
    turned = np.angle(ratio * np.exp(-1j * np.median(np.angle(ratio)))) if len(ratio) else np.empty(0)
    along, across = longer / np.sqrt(scale_deviation**2 + walk), turned / np.sqrt(_HEADING_SPREAD**2 + walk)
    distance = "the corrected path is as long as the odometry says"
    if _worst(along) > _LIMIT:
        worst = longer[np.argmax(np.abs(along))]
        side = "longer" if worst > 0.0 else "shorter"
        distance = f"the corrected path is {percent(abs(worst))} {side} than the odometry says"
    direction = "the corrected path turns as the odometry does"
    if _worst(across) > _LIMIT:
        angle = np.degrees(np.abs(turned[np.argmax(np.abs(across))]))
        direction = f"the corrected path is turned by {angle:.0f} deg against the odometry"
    return (
        _against_limit(
            "distance against odometry", distance, along, starts,
            "Is the corrected path as long as the odometry says, within what the odometry may err?",
        ),
        _against_limit(
            "direction against odometry", direction, across, starts,
            "Does the corrected path turn as the odometry does, all along the run?",
        ),
    )  # fmt: skip


def _against_limit(name: str, text: str, deviations: np.ndarray, starts: np.ndarray, question: str) -> Verdict:
    """Return a verdict on deviations (n,) of windows from `starts` (n,) s on."""
    if not len(deviations):
        text = f"the vehicle went less than {_SHORTEST:g} m in any {_WINDOW:g} s"
        return Verdict(name, np.nan, _LIMIT, text, question=question)
    worst, doubtful = _worst(deviations), merged(starts[np.abs(deviations) > _LIMIT], _WINDOW)
    text += f" ({worst:.1f} standard deviations of the odometry, limit {_LIMIT:g})"
    return Verdict(name, worst, _LIMIT, text, doubtful=doubtful, question=question)


def _worst(deviations: np.ndarray) -> float:
    return float(np.abs(deviations).max()) if len(deviations) else np.nan


def settings_agree(times: np.ndarray, paths: np.ndarray, deviations: np.ndarray) -> Verdict:
    """Return how far paths of other settings or starts lie from the first one, in its stated standard deviations.

    times: (m,) s. paths: (k, m, >= 2), the first is the one that is told. deviations: (m,) m, 2-D standard deviations.
    The value is the root mean square over the run of the farthest path.
    """
    name, limit = "spread over settings", _SPREAD_LIMIT
    question = "Does the path stay where it is when the solver's settings change a little?"
    if len(paths) < 2:
        return Verdict(name, np.nan, limit, "no path of other settings", question=question)
    distance = np.hypot(*np.moveaxis(paths[1:, :, :2] - paths[0, :, :2], 2, 0)) / deviations
    far = merged(times[(distance > limit).any(axis=0)], float(np.median(np.diff(times))))
    value = float(np.sqrt((distance**2).mean(axis=1)).max())
    text = "the solver's other settings find the same path"
    if value > limit:
        text = "the path depends on the solver's settings"
    text += f" ({value:.1f} of its standard deviations away, limit {limit:g})"
    return Verdict(name, value, limit, text, doubtful=far, question=question)


def starts_agree(
    times: np.ndarray, path: np.ndarray, other_start: np.ndarray, other_path: np.ndarray, limit: float = 0.5
) -> Verdict:
    """Return which share of the way from a path to another start is left between it and the path found from there.

    times: (m,) s. path, other_start, other_path: (m, >= 2). The value is the ratio of the root mean squares.
    """
    displaced, left = (np.hypot(*(one - path)[:, :2].T) for one in (other_start, other_path))
    ratio = float(np.sqrt((left**2).mean() / max((displaced**2).mean(), np.finfo(float).tiny)))
    far = merged(times[left > limit * displaced.max()], float(np.median(np.diff(times)))) if ratio > limit else _NOWHERE
    text = "the solver does not come back to its path" if ratio > limit else "the solver comes back to its path"
    text += f" from a standard deviation beside it ({percent(ratio)} of the way is left, limit {percent(limit)})"
    question = "Does the solver come back to the same path when it starts a standard deviation beside it?"
    return Verdict("second start", ratio, limit, text, doubtful=far, question=question)


def position_uncertainty(
    times: np.ndarray, deviations: np.ndarray, expected: np.ndarray, limit: float = LARGEST_DEVIATION
) -> Verdict:
    """Return by how much the path's own 2-D standard deviations have grown beyond those expected in any water.

    times: (m,) s. deviations, expected: (m,) m. On simulated tours that went well they grew by 3.3 m at most, on lost
    ones and in open water by 8 m and more.
    """
    step = float(np.median(np.diff(times))) if len(times) > 1 else 0.0
    grown = np.sqrt(np.maximum(deviations**2 - expected**2, 0.0))
    worst = int(np.argmax(grown))
    text = f"position uncertainty reaches {deviations[worst]:.1f} m (start, compass and lengths explain "
    text += f"{expected[worst]:.1f} m, limit {limit:g} m more)"
    question = "How far off may the position be, by the solver's own account?"
    doubtful = merged(times[grown > limit], step)
    return Verdict("position uncertainty", float(grown[worst]), limit, text, doubtful=doubtful, question=question)


def mount_told(mounts: float) -> Tuple[Verdict, ...]:
    """Return that nothing tells how the sonar is turned; nothing where something does.

    mounts: rad, by how much it may be, by the stated deviations; 0 where a usual course tells it.
    """
    if not mounts:
        return ()
    text = f"no usual course tells how the sonar is turned; {np.degrees(mounts):.0f} deg are in the stated deviations"
    question = "Does the vehicle go as a sonar sees it that is mounted as tf says?"
    return (Verdict("direction of the sonar", np.nan, 0.0, text, question=question),)


def per_minute(times: np.ndarray, deviations: np.ndarray) -> np.ndarray:
    """Return the mean of `deviations` (m,) in each minute from the first of `times` (m,) [s] on; NaN for a gap."""
    minutes = ((times - times[0]) // 60.0).astype(int)
    with np.errstate(invalid="ignore"):
        return np.bincount(minutes, deviations) / np.bincount(minutes)


def halves_agree(
    names: Sequence[str], first: np.ndarray, first_deviations: np.ndarray, second: np.ndarray,
    second_deviations: np.ndarray,
) -> Verdict:  # fmt: skip
    """Return by how many deviations the halves' calibrations (n,) differ at most; `names` (n,) are what they are."""
    worst, distance = _most_apart(first, second, np.hypot(first_deviations, second_deviations))
    found = f"{first[worst]:.3g} and {second[worst]:.3g}, {distance:.1f} standard deviations apart, "
    found += f"limit {_APART_LIMIT:g}"
    text = f"both halves of the run find the same calibration ({names[worst]} {found})"
    if distance > _APART_LIMIT:
        text = f"the halves of the run disagree on {names[worst]} ({found})"
    question = "Do the first and the second half of the run find the same errors of sonar and odometry?"
    return Verdict("calibration of the halves", distance, _APART_LIMIT, text, question=question)


def as_expected(names: Sequence[str], expected: np.ndarray, deviations: np.ndarray, found: np.ndarray) -> Verdict:
    """Return by how many deviations what a run `found` (n,) is from what was `expected` (n,) before it, at most.

    `names` (n,) are what they are; n > 0. deviations: (n,) standard ones of what was expected.
    """
    worst, distance = _most_apart(expected, found, deviations)
    before = f"expected {expected[worst]:.3g} +- {deviations[worst]:.3g}"
    before += f", {distance:.1f} standard deviations away, limit {_APART_LIMIT:g}"
    text = f"calibration as expected ({names[worst]} {found[worst]:.3g}, {before})"
    if distance > _APART_LIMIT:
        text = f"{names[worst]} {found[worst]:.3g} is unlikely for such a device and mounting ({before})"
    question = "Are the errors of sonar and odometry as large as those of such devices, mounted as described?"
    return Verdict("calibration as expected", distance, _APART_LIMIT, text, question=question)


def _most_apart(first: np.ndarray, second: np.ndarray, deviations: np.ndarray) -> Tuple[int, float]:
    """Return where two values (n,) are the most standard deviations (n,) apart, and how many."""
    distances = np.abs(np.subtract(first, second)) / deviations
    worst = int(np.argmax(distances))
    return worst, float(distances[worst])


def odometry_decided(doubt: Optional[Doubt]) -> Tuple[Verdict, ...]:
    """Return whether the odometry that is not believed makes the position more uncertain than all the rest does.

    None where there is only one.
    """
    if doubt is None:
        return ()
    limit = max(doubt.own, _LEAST_DOUBT)
    text = "it is clear" if doubt.deviation <= limit else "it is not clear"
    text += f" which odometry the vehicle has ({doubt.told}; with {doubt.other} it is {doubt.apart:.1f} m elsewhere, "
    text += f"which adds {doubt.deviation:.1f} m to the stated deviation, limit {limit:.1f} m)"
    question = "Do the echoes tell whether the distances are a DVL's, where the profile auto leaves that open?"
    return (Verdict("odometry decided", doubt.deviation, limit, text, question=question),)
