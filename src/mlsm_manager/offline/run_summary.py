"""What map_bag says of a run: summary.json, and its last lines on the terminal."""

from argparse import Namespace
from typing import Any, Dict, List

from mlsm_manager.offline.bag_mapping import MappedBag
from mlsm_manager.offline.run_files import CORRECTED, ODOMETRY, REFINED, REPORT

# Loops that are printed; summary.json has all.
_MOST_LOOPS = 5


def summary_of(mapped: MappedBag, errors: Dict[str, Dict[str, float]], seconds: float) -> Dict[str, Any]:
    """Return what summary.json holds. errors: of each trajectory. seconds: how long the run took."""
    parameters = mapped.parameters
    return {
        **mapped.run.counts,
        "odometry": {"profile": mapped.odometry.kind.value.lower(), "reason": mapped.odometry.reason},
        "beams_without_transform": mapped.recording.unplaced,
        "seconds": round(seconds, 2),
        "times_real_time": round(mapped.recording.seconds / seconds, 1),
        "echoes": {"mode": parameters.mode.value, "match_resolution": parameters.match_resolution},
        **({} if mapped.found is None else mapped.found.to_mapping()),
        **({"found_again": mapped.replayed.found_again} if mapped.replayed.found_again else {}),
        **({"sessions": [session.to_mapping() for session in mapped.sessions]} if mapped.sessions else {}),
        **errors,
    }


def summary_lines(summary: Dict[str, Any], options: Namespace) -> List[str]:
    """Return what map_bag prints at its end."""
    alone = summary["scans"] - summary["matched"] - summary["rejected"]
    lines = [
        f"{summary['scans']} scans, {summary['matched']} matched, {summary['rejected']} rejected, "
        f"{alone} with nothing to match; {summary['blocks']} blocks; {summary['seconds']} s, "
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
        lines.append(f"{session['bag']}: {session['scans']} scans, {session['matched']} matched, {place}")
    lines += [f"found again after a silence of the sonar at {line}" for line in summary.get("found_again", [])]
    if "loops" in summary:
        lines += [f"loop: {line}" for line in summary["loops"]["found"][:_MOST_LOOPS]]
    if "trust" in summary:
        lines.append(summary["trust"])
    files = ["map.mlsm", "map.ply", "map.png", "trajectory.csv", "*.tum", "live.yaml", "summary.json"]
    if (options.out / REPORT).exists():
        files.append(REPORT)
    return [*lines, f"in {options.out}: {' '.join(files)}"]
