"""7.2: a recorded scan through the processing chain."""

import math

import numpy as np
from benchmarks.recorded import recorded_beams
from benchmarks.tank_recording import BEAMS_PER_TURN, HEAD_PLACE, RECORDING

from sonar_processing.beams.placed_beam import PlacedBeam
from sonar_processing.cloud import IntensityCloud
from sonar_processing.scans.assembler import ScanAssembler
from sonar_processing.scans.parameters import SonarToCloudParameters
from sonar_processing.shapes.lines import LineDetectorParameters
from thesis_results.markdown import joined, prose, table
from thesis_results.pictures import Pictures
from thesis_results.processing_chain import draw_stages, processed

RECORDINGS = (RECORDING,)
REACH = 10.0
# A tank is a tenth of the basin, so are its walls and what counts as near one.
TANK_LINES = LineDetectorParameters(distance=0.1, min_length=1.5, max_gap=2.0)


def make(pictures: Pictures) -> str:
    """Return the section."""
    scan = processed(_turn(), HEAD_PLACE[:2, 3], TANK_LINES)
    changed = ", ".join(f"`{name}: {getattr(TANK_LINES, name):g}`" for name in ("distance", "min_length", "max_gap"))
    rows = [
        [
            f"{line.distance_from(HEAD_PLACE[:2, 3]):.2f} m", f"{math.degrees(line.orientation):.1f} deg",
            f"{line.length:.1f} m", str(line.echoes), f"{100.0 * line.residual:.0f} cm",
        ]
        for line in scan.lines
    ]  # fmt: skip
    return joined(
        draw_stages(
            pictures, "processed_recording", scan, REACH,
            """One turn of a real Micron in a tank. The walls of the tank are about 4 m to either side, 2.1 m and 1
            m away; what is behind them are mirror echoes. Compare with figure 7.3 of the thesis.""",
        ),
        prose(f"""Otsu's threshold is {scan.otsu:.0f}; {scan.threshold:.0f} was used. `line_detector` was told the
        size of a tank: {changed}. What it found:"""),
        table(["distance from the sonar", "direction of the normal", "length", "echoes", "rms of residuals"], rows),
    )  # fmt: skip


def _turn() -> IntensityCloud:
    """Return the first turn as an organised cloud in the frame of the tank."""
    assembler = ScanAssembler(SonarToCloudParameters(keep_organized=True, scan_size=BEAMS_PER_TURN))
    clouds = (assembler.add(PlacedBeam(beam, HEAD_PLACE, is_moving=False)) for beam in recorded_beams(RECORDING).beams)
    return next(cloud for cloud in clouds if cloud is not None and np.count_nonzero(cloud.valid))
