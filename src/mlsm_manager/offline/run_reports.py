"""What map_bag says of a run: summary.json, its last lines on the terminal, and report.html."""

from argparse import Namespace
from datetime import datetime, timezone
from typing import Any, Dict, List

import numpy as np

from georeferencing.adjustment import Adjusted
from mlsm_manager.offline.bag_mapping import MappedBag
from mlsm_manager.offline.charts import CHART_FILES
from mlsm_manager.offline.replay import CORRECTED, ODOMETRY
from mlsm_manager.offline.run_files import MCAP, REFINED, REPORT, positions_at, trajectories_of
from mlsm_manager.offline.trust import WITHIN
from mlsm_manager.report.mission import Mission, ScanRecord
from mlsm_manager.scan_matching.scan import Scan, Track
from mlsm_manager.self_check.verdict import RunAnswer
from node_support.errors import counted
from node_support.geometry import move_of, transformed

_FIRST_YEAR = 1990  # of recordings
_MOST_LOOPS = 5  # loops that are printed; summary.json has all


def summary_of(mapped: MappedBag, errors: Dict[str, Dict[str, float]], seconds: float) -> Dict[str, Any]:
    """Return what summary.json holds. errors: of each trajectory. seconds: how long the run took."""
    parameters, rivals = mapped.parameters, mapped.replayed.rivals
    lead = {} if rivals is None or np.isnan(rivals.lead) else {"lead": round(rivals.lead, 1)}
    return {
        **mapped.run.counts,
        "odometry": {"profile": mapped.odometry.name, "reason": mapped.odometry.reason, **lead},
        "beams_without_transform": mapped.recording.unplaced,
        "seconds": round(seconds, 2),
        "times_real_time": round(mapped.recording.seconds / seconds, 1),
        "echoes": {"mode": parameters.mode.value, "match_resolution": parameters.match_resolution},
        **({} if mapped.findings is None else mapped.findings.to_mapping()),
        **({"found_again": mapped.replayed.found_again} if mapped.replayed.found_again else {}),
        **({"sessions": [session.to_mapping() for session in mapped.sessions]} if mapped.sessions else {}),
        **errors,
    }


def summary_lines(summary: Dict[str, Any], options: Namespace) -> List[str]:
    alone = summary["scans"] - summary["matched"] - summary["rejected"]
    lines = [
        f"{counted(summary['scans'], 'scan')}, {summary['matched']} matched, {summary['rejected']} rejected, "
        f"{alone} with nothing to match; {counted(summary['blocks'], 'block')}; {summary['seconds']} s, "
        f"{summary['times_real_time']} times real time",
        f"odometry: {summary['odometry']['profile']}, because {summary['odometry']['reason']}",
    ]
    for name in (ODOMETRY, CORRECTED, REFINED):
        if name in summary:
            error = summary[name]
            lines.append(f"{name}: mean {error['mean']} m, sd {error['sd']} m, max {error['max']} m")
    for session in summary.get("sessions", []):
        found = session["found_after_scans"]
        place = "not found in the map, nothing added" if found is None else f"found in the map with scan {found + 1}"
        lines.append(f"{session['bag']}: {counted(session['scans'], 'scan')}, {session['matched']} matched, {place}")
    lines += [f"found again after a silence of the sonar at {line}" for line in summary.get("found_again", [])]
    if "loops" in summary:
        lines += [f"loop: {line}" for line in summary["loops"]["found"][:_MOST_LOOPS]]
    if "origin" in summary:
        lines.append(_origin_line(summary["origin"]))
    if "trust" in summary:
        lines.append(summary["trust"])
    files = ["map.mlsm", "map.ply", "map.png", "trajectory.csv", "*.tum", "live.yaml", "summary.json"]
    files += [name for name in (REPORT, MCAP, *CHART_FILES) if (options.out / name).exists()]
    return [*lines, f"in {options.out}: {' '.join(files)}"]


def _origin_line(origin: Dict[str, Any]) -> str:
    place = "origin: {latitude:.7f}, {longitude:.7f}, azimuth {azimuth:.2f}".format(**origin)
    if not origin["fixes"]:
        return place
    told = "; deviations {deviation:.2f} m and {azimuth_deviation:.2f} degrees, by {fixes} fixes, {outliers} left out"
    return place + told.format(**origin) + (f"; {origin['note']}" if origin["note"] else "")


def mission_of(mapped: MappedBag, errors: Dict[str, Dict[str, float]]) -> Mission:
    """Return what a report tells; the first recording's path and scans, the map of all. errors: of each trajectory."""
    run, findings = mapped.run, mapped.findings
    return Mission(
        title=mapped.title,
        headline="trust: NOT MEASURED: no solver ran" if findings is None else findings.trust.line,
        paths=trajectories_of(run, mapped.recording),
        scans=_scan_records(mapped),
        blocks=run.blocks,
        verdicts=[] if findings is None else findings.trust.verdicts,
        calibration={} if findings is None else findings.calibration.by_name,
        facts=_facts(mapped),
        parameters=mapped.parameters.to_mapping(),
        uncertainty=None if findings is None else findings.trust.uncertainty,
        errors=errors,
        further=run.further,
        origin=run.stored.origin,
        answer=RunAnswer.UNMEASURED if findings is None else findings.trust.answer,
    )


def _facts(mapped: MappedBag) -> Dict[str, str]:
    recording, run, odometry = mapped.recording, mapped.run, mapped.odometry
    length, counts = float(np.hypot(*np.diff(run.best[:, :2], axis=0).T).sum()), run.counts
    origin, begin = run.stored.origin, datetime.fromtimestamp(recording.beams[0].beam.stamp_ns * 1e-9, timezone.utc)
    heights = np.array([placed.T_target_sonar[2, 3] for placed in recording.beams])
    shallow, deep = -np.percentile(heights, [95.0, 5.0]) + 0.0
    return {
        # A clock that was never set, or a simulated one, counts from 1970.
        "date": begin.strftime("%Y-%m-%d %H:%M UTC") if begin.year >= _FIRST_YEAR else "not recorded",
        "place": "not told; N? is north if headings count from east" if origin is None else str(origin),
        "depth": f"{shallow:.1f} to {deep:.1f} m" if np.ptp(heights) > 0.0 else "not recorded",
        "accuracy": _accuracy(mapped),
        "distance travelled": f"{length:.0f} m",
        "duration": f"{recording.seconds / 60.0:.1f} minutes",
        "odometry": f"{odometry.name}, because {odometry.reason}",
        "beams": f"{len(recording.beams)}, and {recording.unplaced} that could not be placed",
        "scans": f"{counts['scans']}: {counts['matched']} matched, {counts['rejected']} rejected",
        "map": f"{counted(counts['blocks'], 'block')}, cells of {run.blocks.resolution:g} m",
    }


def _accuracy(mapped: MappedBag) -> str:
    """Return within what the position is known with 95 % along the whole path, in the map and on the Earth."""
    run, trust, origin = mapped.run, mapped.run.trust, mapped.run.stored.origin
    if trust is None or trust.uncertainty is None:
        return "nothing can be said of it"
    told = f"within {WITHIN * trust.deviations.max():.1f} m in the map"
    if origin is None or not origin.covariance.any():
        return told
    places = positions_at(run.times, run.best, trust.times)
    charted = mapped.charted or Adjusted(origin)
    both = np.trace(charted.covariances(places, trust.deviations**2 / 2.0), axis1=1, axis2=2)
    return f"{told}, within {WITHIN * np.sqrt(both.max()):.1f} m on the Earth"


def _scan_records(mapped: MappedBag) -> List[ScanRecord]:
    stamps = mapped.recording.times
    pace = float(np.median(np.diff(stamps))) if len(stamps) > 1 else np.inf
    records, before = [], 0
    for update in mapped.replayed.updates:
        after = int(np.searchsorted(stamps, update.scan.reference_time, side="right"))
        missing = 0  # beams that did not come, where the head sends one every `pace` seconds
        if 0.0 < pace < np.inf:
            missing = int(np.maximum(np.round(np.diff(stamps[before:after]) / pace) - 1.0, 0.0).sum())
        rejection = ""
        if not update.accepted:
            result = update.result
            rejection = "no match was made" if result is None else result.reason or result.status.value
        points = _in_map(update.scan, mapped)
        records.append(ScanRecord(update.scan.reference_time, points, after - before, missing, rejection))
        before = after
    return records


def _in_map(scan: Scan, mapped: MappedBag) -> np.ndarray:
    """Return the points (n, 2) of a scan where the best path says that they are."""
    if mapped.solution is not None:
        return mapped.solution.heard(scan)[0][:, :2]
    poses = Track(mapped.run.times, mapped.run.best).at(scan.times)
    return transformed(move_of(scan.track.at(scan.times), poses), scan.points)[:, :2]
