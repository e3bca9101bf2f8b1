"""Beyond the thesis: from how far off a scan finds its place, and whether the stated deviations are true."""

from itertools import product
from typing import Dict, List, Mapping

import numpy as np
from benchmarks.heads import mean_figures
from benchmarks.matchers import MATCHERS, MatcherName
from benchmarks.matching_figures import NEAR, NEAR_YAW, WIDE, started, tour_map
from benchmarks.scans import KINDS, ScanMaker, SonarKind
from benchmarks.tours import simulated
from matplotlib.axes import Axes
from matplotlib.image import AxesImage
from scipy.stats import chi2

from mlsm_manager.scan_matching.distribution_matcher import DistributionMatcher, DistributionMatcherParameters
from mlsm_manager.scan_matching.scan import Matcher
from thesis_results.moves import SEEDS, session_errors, session_scans, session_track
from thesis_results.page import joined, prose, table
from thesis_results.pictures import Pictures, new_figure

_BASE = KINDS[0]
_DISTANCES = (0.5, 1.0, 2.0, 3.0, 4.5, 6.0, 8.0)  # m
_ANGLES = (2.0, 10.0, 20.0, 30.0, 45.0, 60.0)  # deg
_STARTS = 10
_JOINT_KINDS = (KINDS[0], KINDS[2])
_DRAWS = 6
_FEWEST = 10  # runs: fewer make no distribution
_STATES = 3
"""Of a pose: x, y and heading."""


def make_convergence(pictures: Pictures) -> str:
    """Return the section of starts that are off by a distance and an angle."""
    maker = ScanMaker("basin", _BASE)
    target = tour_map(maker)
    matchers = _matchers()
    figure, (axes,) = new_figure(15.0, 4.6, 1, len(matchers))
    wrong = {}
    for cell, (title, matcher) in zip(axes, matchers.items()):
        starts = {
            case: [started(maker, target, matcher, case[0], np.radians(case[1]), seed) for seed in range(_STARTS)]
            for case in product(_DISTANCES, _ANGLES)
        }
        found = np.array([np.mean([one.found for one in same]) for same in starts.values()])
        wrong[title] = sum(one.result.accepted and not one.found for same in starts.values() for one in same)
        image = _draw_shares(cell, title, 100.0 * found.reshape(len(_DISTANCES), len(_ANGLES)))
    figure.colorbar(image, ax=list(axes), label="found, %", shrink=0.8)
    total = _STARTS * len(_DISTANCES) * len(_ANGLES)
    return joined(
        prose(f"""A scan of the basin is matched with the map of the tour, from an expectation that is off in a
        random direction; {_STARTS} scans for each distance and angle, {_BASE}. Found: accepted, and within {NEAR:g} m
        and {np.degrees(NEAR_YAW):.0f} degrees of the truth."""),
        pictures.save(
            "convergence",
            figure,
            f"""Share of the scans that find their place. Left: generalised ICP, which does not search. Middle: the
            default, which searches up to {_reach({})} from the expectation. Right: up to {_reach(WIDE)}.""",
        ),
        f"Accepted at a wrong place: {', '.join(f'{title} {count} of {total}' for title, count in wrong.items())}.",
    )


def _matchers() -> Dict[str, Matcher]:
    return {
        "`GICP`": MATCHERS[MatcherName.GICP](),
        "`DISTRIBUTIONS`": MATCHERS[MatcherName.DISTRIBUTIONS](),
        "`DISTRIBUTIONS`, wide search": DistributionMatcher(DistributionMatcherParameters().changed(WIDE)),
    }


def _reach(changes: Mapping[str, object]) -> str:
    parameters = DistributionMatcherParameters().changed(changes)
    return f"{parameters.search_distance:g} m and {np.degrees(parameters.search_angle):.0f} degrees"


def _draw_shares(axes: Axes, title: str, found: np.ndarray) -> AxesImage:
    image = axes.imshow(found.T, origin="lower", cmap="RdYlGn", vmin=0.0, vmax=100.0, aspect="auto")
    for (column, row), value in np.ndenumerate(found):
        axes.text(column, row, f"{value:.0f}", ha="center", va="center", fontsize="small")
    axes.set_xticks(range(len(_DISTANCES)))
    axes.set_xticklabels([f"{distance:g}" for distance in _DISTANCES])
    axes.set_yticks(range(len(_ANGLES)))
    axes.set_yticklabels([f"{angle:g}" for angle in _ANGLES])
    axes.set(xlabel="distance of the expectation, m", ylabel="angle, deg", title=title.replace("`", ""))
    return image


def make_consistency(pictures: Pictures) -> str:
    """Return the section of squared errors over stated variances."""
    squares = {kind: _last_squares(kind) for kind in KINDS}
    figure, ((axes,),) = new_figure(7.5, 4.8)
    _draw_squares(axes, squares)
    joint = [_joint(world, kind) for world in ("basin", "harbour") for kind in _JOINT_KINDS]
    return joined(
        prose(f"""A fix comes with a covariance. Its normalised estimation error squared (NEES), the squared error
        divided by that covariance, is {_STATES} on average where the covariance is true, for x, y and heading; more
        where the matcher is too sure of itself."""),
        f"Of the three moves, the last accepted fix of each of {SEEDS} runs, since fixes of one run share a map:",
        table(
            ["sonar", "runs with a fix", "mean NEES", "95 % band of a true one"],
            [_row(kind, found) for kind, found in squares.items()],
        ),
        pictures.save(
            "consistency",
            figure,
            """How often a squared error stays below a value, and how often it should (black). A curve to the right
            of the black one: too sure.""",
        ),
        prose(f"""The joint solver on simulated tours, whose odometry has errors as a DVL and a compass have them,
        drawn {_DRAWS} times: NEES of x and y per state (1 is true), live and of the whole run fitted afterwards
        (batch). All fixes of one run share its odometry, so these means scatter much."""),
        table(["tour", "sonar", "live: error", "deviation", "NEES", "batch: error", "deviation", "NEES"], joint),
    )  # fmt: skip


def _last_squares(kind: SonarKind) -> np.ndarray:
    maker, track = ScanMaker("basin", kind), session_track()
    found = []
    for seed in range(SEEDS):
        errors = session_errors(session_scans(maker, seed, track), MatcherName.DISTRIBUTIONS)
        accepted = errors[errors[:, 0] > 0]
        if len(accepted):
            found.append(accepted[-1, 3])
    return np.array(found)


def _row(kind: SonarKind, squares: np.ndarray) -> List[str]:
    if not len(squares):
        return [str(kind), f"0 of {SEEDS}", "", ""]
    low, high = chi2.ppf([0.025, 0.975], _STATES * len(squares)) / len(squares)
    return [str(kind), f"{len(squares)} of {SEEDS}", f"{squares.mean():.2f}", f"{low:.2f} to {high:.2f}"]


def _joint(world: str, kind: SonarKind) -> List[str]:
    found = mean_figures(simulated(f"{world}_tour", kind), _DRAWS)
    cells = [text for one in found for text in (f"{one.mean:.2f} m", f"{one.stated:.2f} m", f"{one.nees:.2f}")]
    return [world, str(kind), *cells]


def _draw_squares(axes: Axes, squares: Dict[SonarKind, np.ndarray]) -> None:
    for kind, found in squares.items():
        if len(found) >= _FEWEST:
            shares = (np.arange(len(found)) + 1.0) / len(found)
            axes.step(np.sort(found), shares, where="post", label=f"{kind}, {len(found)} runs")
    values = np.linspace(0.0, 14.0, 200)
    axes.plot(values, chi2.cdf(values, _STATES), color="k", label=f"chi-squared, {_STATES} degrees of freedom")
    axes.set(xlabel="squared error, normalised", ylabel="share of the runs", xlim=(0.0, 14.0))
    axes.legend(loc="lower right", fontsize="small")
    axes.grid(True, linewidth=0.4)
