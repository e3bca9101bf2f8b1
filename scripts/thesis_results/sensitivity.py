"""Beyond the thesis: how the error of a fix depends on the simulated sonar."""

from dataclasses import dataclass, replace
from typing import Dict, List, Sequence

import numpy as np
from benchmarks.matchers import MATCHERS, MatcherName
from benchmarks.matching_scans import KINDS, RAYS, ScanMaker, SonarKind
from benchmarks.matching_starts import Start, started, tour_map
from matplotlib.axes import Axes

from thesis_results.markdown import joined, prose, table
from thesis_results.pictures import Pictures, new_figure

SCANS = 30
OFF, TURNED = 1.0, np.radians(5.0)
"""How far the expectation is off, m and rad."""
SPREADS = (0.05, 0.15, 0.4, 1.0)  # m; 0.15 is a real pulse, 1 the thesis's model
NOISE = (0, 15, 30, 60, 120)  # echoes in each beam; 15 is the thesis's model
_BASE = KINDS[0]


@dataclass(frozen=True)
class Found:
    """Errors (n,) m of accepted fixes, and how many of all scans they are."""

    errors: np.ndarray
    accepted: float

    @classmethod
    def of(cls, starts: Sequence[Start]) -> "Found":
        """Return what matches make."""
        errors = [one.error for one in starts if one.result.accepted]
        return cls(np.array(errors), len(errors) / len(starts))

    def quantile(self, share: float) -> float:
        """Return the error that this share of the fixes stay below, m; NaN without a fix."""
        return float(np.quantile(self.errors, share)) if len(self.errors) else np.nan

    @property
    def cell(self) -> str:
        """Cell of a table."""
        if not len(self.errors):
            return "none"
        return f"{self.quantile(0.5):.2f} m, {self.quantile(0.95):.2f} m, {100.0 * self.accepted:.0f} %"


def make(pictures: Pictures) -> str:
    """Return the section."""
    by_pulse = {spread: {rays: _found(_kind(rays, spread)) for rays in RAYS} for spread in SPREADS}
    by_noise = {
        rays: {noise: _found(replace(_kind(rays, _BASE.spread), noise_echoes=noise)) for noise in NOISE}
        for rays in (45, 500)
    }
    figure, (axes,) = new_figure(13.0, 4.8, 1, 2)
    _draw(axes[0], {f"pulse {spread:g} m": found for spread, found in by_pulse.items()}, "rays per beam")
    axes[0].set(xscale="log")
    axes[0].set_xticks(list(RAYS))
    axes[0].set_xticklabels([str(rays) for rays in RAYS])
    _draw(axes[1], {f"{rays} rays": found for rays, found in by_noise.items()}, "noise echoes in each beam")
    axes[1].axvline(_BASE.noise_echoes, color="#999999", linewidth=0.8)
    return joined(
        prose(f"""One match each of {SCANS} scans of the basin with a map made with the same sonar (`laser_cone`),
        from an expectation that is {OFF:g} m and {np.degrees(TURNED):.0f} degrees off. More rays describe a beam
        more completely, so that small things are hit; the pulse is the standard deviation of an echo along range."""),
        pictures.save(
            "sensitivity",
            figure,
            """Error of the accepted fixes: median (points) and 95 % (upper ends). Where fewer than half of the
            scans were accepted, the point is hollow. The grey line marks the noise of the thesis's model.""",
        ),
        "Median, 95 % and share of the accepted fixes:",
        table(
            ["rays", *(f"pulse {spread:g} m" for spread in SPREADS)],
            [[str(rays), *(by_pulse[spread][rays].cell for spread in SPREADS)] for rays in RAYS],
        ),
        table(
            ["noise echoes", *(f"{rays} rays" for rays in by_noise)],
            [[str(noise), *(found[noise].cell for found in by_noise.values())] for noise in NOISE],
        ),
    )


def _kind(rays: int, spread: float) -> SonarKind:
    """Return a sonar whose echoes the extractor is set for, as the kinds of the benchmarks are."""
    return SonarKind(rays, spread, min(2.0 * spread, 1.0))


def _found(kind: SonarKind) -> Found:
    maker = ScanMaker("basin", kind)
    target = tour_map(maker)
    matcher = MATCHERS[MatcherName.DISTRIBUTIONS]()
    return Found.of([started(maker, target, matcher, OFF, TURNED, seed) for seed in range(SCANS)])


def _draw(axes: Axes, lines: Dict[str, Dict[float, Found]], what: str) -> None:
    for name, found in lines.items():
        places: List[float] = list(found)
        medians, most = (np.array([one.quantile(share) for one in found.values()]) for share in (0.5, 0.95))
        spread = np.array([np.zeros(len(medians)), most - medians])
        bars = axes.errorbar(places, medians, spread, capsize=3.0, label=name, linewidth=1.2)
        for place, median, one in zip(places, medians, found.values()):
            filled = bars[0].get_color() if one.accepted >= 0.5 else "white"
            axes.plot(place, median, "o", color=bars[0].get_color(), markerfacecolor=filled)
    axes.set(xlabel=what, ylabel="error of the position, m")
    axes.set_ylim(bottom=0.0)
    axes.legend()
    axes.grid(True, linewidth=0.4)
