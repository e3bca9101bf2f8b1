"""Reports to the diagnostics what was done with scans and clouds."""

from typing import Sequence

from mlsm_manager.localisation.map_updates import CloudUpdate, ScanUpdate
from mlsm_manager.self_check.verdict import Verdict
from node_support.health import Health

_PROVISIONAL = "provisional: one scan of an unknown velocity; the next ones draw it anew"


def report_scan(health: Health, update: ScanUpdate, matching: bool) -> None:
    """Count a scan and show what its match found."""
    health.show("matching", "on" if matching else "off")
    if matching:
        health.show("map", _PROVISIONAL if update.provisional else "scans agree with each other")
    result = update.result
    if result is None:
        health.count("scans placed by odometry")
        return
    health.count("scans matched" if update.accepted else "scans not matched")
    health.show("match status", result.status.name)
    health.show("match error [m]", f"{result.error:.3f}")
    health.show("match points", f"{result.points_used} of {len(update.scan)}")
    health.show("match time [ms]", f"{1e3 * result.seconds:.1f}")
    deviations = result.covariance.diagonal() ** 0.5
    health.show("fix standard deviations x y [m] yaw [rad]", " ".join(f"{value:.3f}" for value in deviations[:3]))
    health.show("odometry scale error", f"{result.motion[0]:.3f}")
    health.show("odometry direction error [rad]", f"{result.motion[1]:.4f}")
    if update.found:
        health.count("times found again after a silence")
        health.show("found again", update.found)
    if not update.accepted:
        health.problem("matches rejected", f"{result.status.name}, {result.reason}; map and correction are kept")


def report_turn(health: Health, seconds: float, longest: float) -> None:
    """Warn of a turn of the head that took longer than the vehicle is assumed to keep its speed."""
    if seconds > longest:
        detail = f"{seconds:.0f} s, must be at most {longest:g} s where no speed is measured"
        health.problem("turns of the head too slow", f"{detail}; take larger steps, fewer samples or a shorter range")


def report_verdicts(health: Health, verdicts: Sequence[Verdict]) -> None:
    """Show what a run says of itself, and warn where it is not to be trusted."""
    for verdict in verdicts:
        health.show(verdict.name, verdict.line())
        if verdict.fires:
            health.problem("position doubtful", f"{verdict.line()}; the map may be smeared: relocalise, or begin anew")


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
