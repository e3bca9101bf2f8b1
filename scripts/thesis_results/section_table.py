"""All sections of the page, in its order; a new one is one line here."""

from typing import Tuple

from thesis_results import (
    consistency,
    convergence,
    marina,
    moving_scan,
    processed_recording,
    processed_scans,
    recorded_scans,
    sensitivity,
    simulated_scans,
    three_moves,
    tilt_survey,
)
from thesis_results.section import Section

SECTIONS: Tuple[Section, ...] = (
    Section("simulation", "7.1", "Simulated scans", simulated_scans.make),
    Section("recorded", "7.1", "Simulated and recorded scans", recorded_scans.make, recorded_scans.RECORDINGS),
    Section("processing", "7.2", "A simulated scan, cleaned", processed_scans.make),
    Section(
        "processing-recorded",
        "7.2",
        "A recorded scan, cleaned",
        processed_recording.make,
        processed_recording.RECORDINGS,
    ),
    Section("mapping", "7.3", "A 3-D survey of the harbour", tilt_survey.make),
    Section("moves", "7.4", "Three moves with an odometry that is 30 % off", three_moves.make),
    Section("moving", "7.4", "A vehicle that never stops", moving_scan.make),
    Section("marina", "7.4", "A real marina", marina.make, marina.RECORDINGS),
    Section("compass", "7.4", "The marina with the compass alone", marina.make_compass_alone, marina.RECORDINGS),
    Section("convergence", "beyond", "From how far off a scan finds its place", convergence.make),
    Section("sensitivity", "beyond", "The error of a fix against rays, pulse and noise", sensitivity.make),
    Section("consistency", "beyond", "Are the stated deviations true?", consistency.make),
)
