"""How far a path on the chart is from the truth: the marina, whose DGPS stands in for a receiver at the surface.

The map is made without it. Then the fixes of some minutes alone say where the map lies, and all of them how far the
path on the chart is off. The first row is the path as `map_bag --truth` compares it, which begins where the truth does.
"""

from typing import Iterator

import numpy as np

from benchmarks.harness import Row, mapped_as, marina
from georeferencing.adjustment import Adjusted
from georeferencing.asked import AskedOrigin
from georeferencing.fixes import Fix
from georeferencing.origin import Origin
from mlsm_manager.offline.bag_mapping import MappedBag
from mlsm_manager.offline.charts import origin_of_fixes
from mlsm_manager.offline.run_files import position_error, positions_at

_PLACE = Origin(42.2, 3.1)  # where the truth's zero is put: the bag does not tell, and errors do not depend on it
_DEVIATION = 1.0  # m, that the receiver states: a DGPS on a buoy, which the vehicle tows
_MINUTE = 60.0
_WANTED = 0.5  # m more than the unreferenced path has
_WITHIN = -2.0 * np.log(0.05)  # squared distance in deviations that holds 95 % in a plane


def rows() -> Iterator[Row]:
    """Yield the rows."""
    mapped = mapped_as(marina(truth="/ground_truth"), "--refine", "--truth", "/ground_truth")
    truth = mapped.recording.truth
    unreferenced = position_error(mapped.run.times, mapped.run.best, truth)
    first, last = truth.times - truth.times[0] <= _MINUTE, truth.times[-1] - truth.times <= _MINUTE
    yield "unreferenced", "mean {mean:.2f} m, max {max:.2f} m".format(**unreferenced), ""
    for what, chosen, asked in (
        ("fixes of the first minute", first, "fixes"),
        ("first and last minute", first | last, "fixes"),
        ("first and last minute, no compass", first | last, "fixes, azimuth unknown"),
        ("all fixes", np.ones(len(truth.times), dtype=bool), "fixes"),
    ):
        places = _PLACE.degrees(truth.positions[chosen])
        fixes = [Fix(time, *place, (_DEVIATION, _DEVIATION)) for time, place in zip(truth.times[chosen], places)]
        figures = _figures(mapped, origin_of_fixes(mapped.run, fixes, AskedOrigin.parsed(asked)))
        yield what, figures, f"<= {unreferenced['mean'] + _WANTED:.2f} m mean"


def _figures(mapped: MappedBag, found: Adjusted) -> str:
    """Return how far the path on the chart lies from the truth."""
    run, truth = mapped.run, mapped.recording.truth
    known = (truth.times >= run.times[0]) & (truth.times <= run.times[-1])
    times = truth.times[known]
    path = positions_at(run.times, run.best, times)
    errors = _PLACE.points(found.origin.degrees(path)) - truth.positions[known]
    covariances = found.covariances(path, np.interp(times, run.trust.times, run.trust.deviations**2 / 2.0))
    distances = np.hypot(*errors.T)
    squares = np.einsum("ni,nij,nj->n", errors, np.linalg.inv(covariances), errors)
    stated = np.sqrt(np.trace(covariances, axis1=1, axis2=2).mean())
    azimuth = f"azimuth {found.origin.azimuth_deg:.2f} +- {np.degrees(np.sqrt(found.origin.covariance[2, 2])):.2f}"
    return (
        f"mean {distances.mean():.2f} m, max {distances.max():.2f} m; stated {stated:.2f} m, "
        f"{100.0 * np.mean(squares <= _WITHIN):.0f} % within 95 %, NEES {squares.mean() / 2.0:.2f}; {azimuth}; "
        f"{found.used} fixes, {found.outliers} left out"
    )
