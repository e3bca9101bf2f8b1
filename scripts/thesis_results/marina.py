"""7.4: a real marina (Ribas et al. 2008), with its odometry and with its compass alone."""

import json
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import List

from benchmarks.harness import ROOT, recorded
from heading_only import reduce_bag

from thesis_results.page import joined, prose, table
from thesis_results.pictures import Pictures

RECORDING = "marina_first.bag"
RECORDINGS = (RECORDING,)


def make(pictures: Pictures) -> str:
    """Return the section of the run with all of its odometry."""
    return joined(
        prose("""The abandoned marina of St Pere Pescador (Ribas et al. 2008): the first twenty minutes of a run of
        a real vehicle that never stops, with a Micron sonar, a DVL and a compass. The thesis had no such recording.
        `map_bag --refine` mapped it; the DGPS on a buoy, which it never sees, is the truth."""),
        *_mapped(pictures, "marina_map", recorded(RECORDING)),
    )


def make_compass_alone(pictures: Pictures) -> str:
    """Return the section of the run with nothing but the heading of its odometry."""
    with tempfile.TemporaryDirectory() as folder:
        bag = Path(folder) / "heading_only.bag"
        reduce_bag(recorded(RECORDING), bag, "odom", "base_link")
        found = _mapped(pictures, "marina_heading_map", bag, "--odometry", "heading")
    return joined(
        prose("""The same run as a vehicle without a DVL would have recorded it: `scripts/heading_only` removes all
        of the odometry but its heading, and `map_bag --odometry heading` estimates the velocity from the scans."""),
        *found,
    )


def _mapped(pictures: Pictures, name: str, bag: Path, *options: str) -> List[str]:
    """Return map and paths, distances from the truth, what the run found of sonar and odometry, and its trust line."""
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, ROOT / "nodes/map_bag", bag, "--out", folder, "--truth", "/ground_truth", "--refine"]
        subprocess.run([*map(str, command), *options], check=True, stdout=subprocess.DEVNULL)
        summary = json.loads((Path(folder) / "summary.json").read_text())
        shown = pictures.copied(
            name, Path(folder) / "map.png",
            """Map and paths as `map_bag` draws them. Corrected: what the vehicle would have known at each moment.
            Refined: the whole run fitted afterwards.""",
        )  # fmt: skip
    rows = [
        [path, *(f"{summary[path.replace(' ', '_')][kind]:.2f} m" for kind in ("mean", "sd", "max"))]
        for path in ("dead reckoning", "corrected", "refined")
    ]
    calibration = ", ".join(
        f"`{key}` {one['value']:.3f} ± {one['deviation']:.3f}" for key, one in summary["calibration"].items()
    )
    return [
        shown,
        table(["distance from DGPS", "mean", "sd", "max"], rows),
        f"What the run found of sonar and odometry: {calibration}.",
        f"`map_bag` says of itself: `{summary['trust']}`.",
    ]
