"""Beyond the thesis: whether the stated deviations are true."""

from typing import Dict, List

import numpy as np
from benchmarks.matchers import DISTRIBUTIONS
from benchmarks.scans import KINDS, ScanMaker, SonarKind
from matplotlib.axes import Axes
from scipy.stats import chi2

from thesis_results.moves import ODOMETRY, SEEDS, matching_estimator, session_errors, session_scans, session_track
from thesis_results.page import joined, prose, table
from thesis_results.pictures import Pictures, new_figure

_FEWEST = 10  # runs: fewer make no distribution
_STATES = 3
"""Of a pose: x, y and heading."""


def make(pictures: Pictures) -> str:
    """Return the section of squared errors over stated variances."""
    squares = {kind: _last_squares(kind) for kind in KINDS}
    figure, ((axes,),) = new_figure(7.5, 4.8)
    _draw_squares(axes, squares)
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
        prose("""How far the deviations of the joint solver on simulated tours are true, `scripts/bench no_parameters
        --rows rays` measures ([matching](matching.md))."""),
    )  # fmt: skip


def _last_squares(kind: SonarKind) -> np.ndarray:
    """Return the squared error over the stated variance of the last accepted fix of each run that has one."""
    maker, track, found = ScanMaker("basin", kind), session_track(), []
    for seed in range(SEEDS):
        estimator = matching_estimator(DISTRIBUTIONS, ODOMETRY)
        errors = session_errors(session_scans(maker, seed, track), estimator)
        found += errors[errors[:, 0] > 0][-1:, 3].tolist()
    return np.array(found)


def _row(kind: SonarKind, squares: np.ndarray) -> List[str]:
    if not len(squares):
        return [str(kind), f"0 of {SEEDS}", "", ""]
    low, high = chi2.ppf([0.025, 0.975], _STATES * len(squares)) / len(squares)
    return [str(kind), f"{len(squares)} of {SEEDS}", f"{squares.mean():.2f}", f"{low:.2f} to {high:.2f}"]


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
