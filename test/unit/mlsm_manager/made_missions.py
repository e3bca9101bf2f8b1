"""Missions for the tests of the report: a vehicle on a circle before a long wall."""

import numpy as np

from mlsm_manager.report.mission import Mission, Path, ScanRecord, Uncertainty
from mlsm_manager.self_check.verdict import Verdict
from mlsm_manager.surface_map.blocks import ROW_WIDTH, Blocks

RESOLUTION = 0.5
START = 1.7e9


def blocks(count):
    """Return `count` blocks of a wall, ten high."""
    rows = np.zeros((count, ROW_WIDTH))
    rows[:, 0] = (np.arange(count) // 10 + 0.5) * RESOLUTION
    rows[:, 2] = np.arange(count) % 10
    rows[:, 8] = 1 + np.arange(count) % 7
    rows[:, 9:] = rows[:, 2:3]
    return Blocks.uncrossed(rows, RESOLUTION)


def verdict(value, limit=4.0, **more):
    return Verdict("distance", value, limit, "longest stretch, deviations", question="Is it as long?", **more)


def mission(block_count=1000, scans=20, verdicts=(), rejections=(), **more):
    """Return a mission of `scans` turns of the head; `rejections` are those of the first scans."""
    times = START + np.arange(scans * 15.0)
    angle = np.linspace(0.0, 2.0 * np.pi, len(times))
    poses = np.column_stack([20.0 * np.cos(angle), 20.0 * np.sin(angle), angle])
    paths = [Path("dead reckoning", "#999999", times, poses * 1.1), Path("corrected", "#1f5fa8", times, poses)]
    ends = times[14::15]
    wall = np.column_stack([np.linspace(-30.0, 30.0, 500), np.full(500, 40.0)])
    reasons = [*rejections, *[""] * (scans - len(rejections))]
    records = [ScanRecord(end, wall + number, 200, number % 3, reasons[number]) for number, end in enumerate(ends)]
    covariances = np.tile(np.diag([1.0, 0.25]), (scans, 1, 1))
    told = Uncertainty(ends, covariances, np.array([[ends[3], ends[5]]]) if scans > 5 else np.empty((0, 2)))
    return Mission(
        title="<mission & run>", headline="trust: <fine>",
        paths=paths, scans=records, blocks=blocks(block_count), verdicts=list(verdicts),
        calibration={"sonar_delay": (0.95, 0.07)}, facts={"duration": "5 minutes"},
        parameters={"resolution": RESOLUTION}, uncertainty=told, **more,
    )  # fmt: skip
