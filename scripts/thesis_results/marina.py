"""7.4: a real marina (Ribas et al. 2008), with its odometry and with its compass alone."""

import subprocess
import sys
import tempfile
from pathlib import Path

from benchmarks.recorded import ROOT, recorded

from thesis_results.markdown import joined, prose, table
from thesis_results.missions import draw_errors, draw_map, error_rows, mapped, trust_line
from thesis_results.pictures import Pictures

RECORDING = "marina_first.bag"
RECORDINGS = (RECORDING,)
_HEADING = ["distance from DGPS", "mean", "sd", "max"]


def make(pictures: Pictures) -> str:
    """Return the section of the run with all of its odometry."""
    mission = mapped(recorded(RECORDING))
    return joined(
        prose("""The abandoned marina of St Pere Pescador (Ribas et al. 2008): the first twenty minutes of a run of
        a real vehicle that never stops, with a Micron sonar, a DVL and a compass. The thesis had no such recording.
        `map_bag --refine` mapped it; the DGPS on a buoy, which it never sees, is the truth."""),
        draw_map(
            pictures, "marina_map", mission,
            """Map and paths. Corrected: what the vehicle would have known at each moment. Refined: the whole run
            fitted afterwards. Dashed: DGPS.""",
        ),
        draw_errors(
            pictures, "marina_errors", mission,
            "Distance from DGPS over time, beside the standard deviation of the position that `map_bag` tells.",
        ),
        table(_HEADING, error_rows(mission)),
        trust_line(mission),
    )  # fmt: skip


def make_compass_alone(pictures: Pictures) -> str:
    """Return the section of the run with nothing but the heading of its odometry."""
    with tempfile.TemporaryDirectory() as folder:
        bag = Path(folder) / "heading_only.bag"
        subprocess.run(
            [sys.executable, str(ROOT / "scripts/heading_only.py"), str(recorded(RECORDING)), str(bag)], check=True
        )
        mission = mapped(bag, "--odometry", "heading")
    return joined(
        prose("""The same run as a vehicle without a DVL would have recorded it: `scripts/heading_only` removes all
        of the odometry but its heading, and `map_bag --odometry heading` estimates the velocity from the scans."""),
        draw_map(pictures, "marina_heading_map", mission, "Map and paths with the compass alone. Dashed: DGPS."),
        draw_errors(pictures, "marina_heading_errors", mission, "Distance from DGPS over time with the compass alone."),
        table(_HEADING, error_rows(mission)),
        trust_line(mission),
    )
