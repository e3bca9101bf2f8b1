"""Beyond the thesis: from how far off a scan finds its place."""

from itertools import product
from typing import Dict, Mapping

import numpy as np
from benchmarks.matchers import MATCHERS, MatcherName
from benchmarks.matching_scans import KINDS, ScanMaker
from benchmarks.matching_starts import NEAR, NEAR_YAW, WIDE, started, tour_map
from matplotlib.axes import Axes
from matplotlib.image import AxesImage

from mlsm_manager.scan_matching.distribution_matcher import DistributionMatcher, DistributionMatcherParameters
from mlsm_manager.scan_matching.result import Matcher
from thesis_results.markdown import joined, prose
from thesis_results.pictures import Pictures, new_figure

KIND = KINDS[0]
DISTANCES = (0.5, 1.0, 2.0, 3.0, 4.5, 6.0, 8.0)  # m
ANGLES = (2.0, 10.0, 20.0, 30.0, 45.0, 60.0)  # deg
STARTS = 10


def make(pictures: Pictures) -> str:
    """Return the section."""
    maker = ScanMaker("basin", KIND)
    target = tour_map(maker)
    matchers = _matchers()
    figure, (axes,) = new_figure(15.0, 4.6, 1, len(matchers))
    wrong = {}
    for cell, (title, matcher) in zip(axes, matchers.items()):
        starts = {
            case: [started(maker, target, matcher, case[0], np.radians(case[1]), seed) for seed in range(STARTS)]
            for case in product(DISTANCES, ANGLES)
        }
        found = np.array([np.mean([one.found for one in same]) for same in starts.values()])
        wrong[title] = sum(one.result.accepted and not one.found for same in starts.values() for one in same)
        image = _draw(cell, title, 100.0 * found.reshape(len(DISTANCES), len(ANGLES)))
    figure.colorbar(image, ax=list(axes), label="found, %", shrink=0.8)
    total = STARTS * len(DISTANCES) * len(ANGLES)
    return joined(
        prose(f"""A scan of the basin is matched with the map of the tour, from an expectation that is off in a
        random direction; {STARTS} scans for each distance and angle, {KIND}. Found: accepted, and within {NEAR:g} m
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


def _draw(axes: Axes, title: str, found: np.ndarray) -> AxesImage:
    image = axes.imshow(found.T, origin="lower", cmap="RdYlGn", vmin=0.0, vmax=100.0, aspect="auto")
    for (column, row), value in np.ndenumerate(found):
        axes.text(column, row, f"{value:.0f}", ha="center", va="center", fontsize="small")
    axes.set_xticks(range(len(DISTANCES)))
    axes.set_xticklabels([f"{distance:g}" for distance in DISTANCES])
    axes.set_yticks(range(len(ANGLES)))
    axes.set_yticklabels([f"{angle:g}" for angle in ANGLES])
    axes.set(xlabel="distance of the expectation, m", ylabel="angle, deg", title=title.replace("`", ""))
    return image
