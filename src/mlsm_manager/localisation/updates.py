"""What became of a scan or a cloud that an estimator took, and what the diagnostics say of it."""

from dataclasses import dataclass
from typing import List, Optional, Sequence

import numpy as np

from mlsm_manager.odometry.steps import Step
from mlsm_manager.scan_matching.scan import Belief, MatchResult, Scan
from mlsm_manager.scan_matching.scan_path import DIRECTION, SCALE
from mlsm_manager.self_check.causes import Cause
from mlsm_manager.self_check.verdict import Verdict
from mlsm_manager.surface_map.free_space import CarveReport
from mlsm_manager.surface_map.insertion import InsertReport
from node_support.health import Health

NOTHING_INSERTED = InsertReport(0, 0)
_PROVISIONAL = "provisional: one scan of an unknown velocity; the next ones draw it anew"


@dataclass(frozen=True)
class ScanUpdate:
    """What was done with a scan.

    result: None when it was not matched. accepted: whether it was put into the map. belief: after the scan.
    found: how the vehicle was found again with it after a silence of the sonar; empty where it was not.
    loop: what place was found that was heard long before, and how far the vehicle was moved; empty where none was.
    forgotten: turns of the head that lay apart from the map and are left out of it, because the run began anew.
    provisional: whether the map hangs on scans of an unknown velocity, none of which agrees with another yet.
    """

    scan: Scan
    result: Optional[MatchResult]
    accepted: bool
    belief: Belief
    found: str = ""
    provisional: bool = False
    forgotten: int = 0
    loop: str = ""


@dataclass(frozen=True)
class CloudUpdate:
    """What was done with a cloud.

    report: of the insertion. waiting: whether it waits for the match of its time. unplaced: number of points that were
    not inserted because the scan of their time was rejected.
    carved: what its beams said about free space, None where nobody asked or the vehicle's position is not known.
    """

    report: InsertReport
    waiting: bool
    unplaced: int
    carved: Optional[CarveReport] = None


@dataclass(frozen=True)
class ScanResult:
    """What was done with a scan, and with the clouds that could be inserted after it."""

    scan: ScanUpdate
    clouds: List[CloudUpdate]


def report_scan(health: Health, update: ScanUpdate, matching: bool) -> None:
    health.show("matching", "on" if matching else "off")
    result = update.result
    if matching:
        health.show("map", _PROVISIONAL if update.provisional else "scans agree with each other")
        health.show("match status", "no echo compared" if result is None else result.status.name)
    if result is None:
        health.count("scans placed by odometry")
        return
    health.count("scans matched" if update.accepted else "scans not matched")
    health.show("match error [m]", f"{result.error:.3f}")
    health.show("match points", f"{result.points_used} of {len(update.scan)}")
    health.show("match time [ms]", f"{1e3 * result.seconds:.1f}")
    deviations = result.covariance.diagonal() ** 0.5
    health.show("fix standard deviations x y [m] yaw [rad]", " ".join(f"{value:.3f}" for value in deviations[:3]))
    health.show("odometry scale error", f"{result.belief.theta[SCALE]:.3f}")
    health.show("odometry direction error [rad]", f"{result.belief.theta[DIRECTION]:.4f}")
    if update.found:
        health.count("times found again after a silence")
        health.show("found again", update.found)
    if update.loop:
        health.count("loops closed")
        health.show("loop", update.loop)
    if not update.accepted:
        health.problem("matches rejected", f"{result.status.name}, {result.reason}; map and correction are kept")


def report_turn(health: Health, seconds: float, longest: float) -> None:
    """Warn of a turn of the head that took longer than the vehicle is assumed to keep its speed."""
    if seconds > longest:
        detail = f"{seconds:.0f} s, must be at most {longest:g} s where no speed is measured"
        health.problem("turns of the head too slow", f"{detail}; take larger steps, fewer samples or a shorter range")


def report_steps(health: Health, steps: Sequence[Step], told: int) -> None:
    """Warn of steps of the odometry that no vehicle makes; `told`: how many were told before."""
    for step in steps[told:]:
        detail = f"{step.text} at {step.time:.1f} s; the step is left out, check the odometry"
        health.problem("steps of the odometry that no vehicle makes", detail)


def report_causes(health: Health, causes: Sequence[Cause], assumed: str) -> None:
    """Show what is found to be wrong and what the path rests on, and warn of what still is wrong."""
    lines = [cause.text if np.isnan(cause.begin) else f"{cause.text} at {cause.begin:.1f} s" for cause in causes]
    health.show("causes", "; ".join(lines) or "none found")
    health.show("assumed", assumed or "nothing")
    wrong = [line for line, cause in zip(lines, causes) if not cause.is_mended]
    if wrong:
        health.problem("seconds with a cause to doubt the position", wrong[0])


def report_verdicts(health: Health, verdicts: Sequence[Verdict]) -> None:
    """Show what a run says of itself, and warn where it is not to be trusted."""
    for verdict in verdicts:
        health.show(verdict.name, verdict.line())
        if verdict.fires:
            health.problem("position doubtful", f"{verdict.text}; the map may be smeared: relocalise, or begin anew")


def report_cloud(health: Health, update: CloudUpdate, blocks: int, limit: float) -> None:
    """Count a cloud and warn of points that did not get into the map."""
    if update.waiting:
        health.count("clouds waiting for their match")
        return
    health.count("points inserted", update.report.inserted)
    health.show("blocks", str(blocks))
    if update.carved is not None:
        health.count("blocks removed because beams went through them", update.carved.removed)
    if update.unplaced:
        health.count("points not inserted because their scan was not matched", update.unplaced)
    if update.report.outside:
        detail = f"{update.report.outside} beyond map_limit of {limit:g} m; check tf"
        health.problem("points outside the map", detail, update.report.outside)
