"""What report.html tells of a run of map_bag."""

from typing import Dict, List

import numpy as np

from mlsm_manager.joint_solver.placing.drawing import drawn
from mlsm_manager.localisation.updates import ScanUpdate
from mlsm_manager.offline.bag_mapping import MappedBag
from mlsm_manager.offline.evaluation import aligned_truth
from mlsm_manager.offline.findings import Found
from mlsm_manager.offline.recording import Recording
from mlsm_manager.offline.run_files import COLORS, LABELS, ODOMETRY, TRUTH_COLOR, Run
from mlsm_manager.report.mission import Mission, Path, ScanRecord, Uncertainty
from mlsm_manager.scan_matching.scan import Scan
from node_support.geometry import composed, inverse, transformed


def mission_of(mapped: MappedBag, errors: Dict[str, Dict[str, float]]) -> Mission:
    """Return what a report tells; the first recording's path and scans, the map of all. errors: of each trajectory."""
    run, found = mapped.run, mapped.found
    return Mission(
        title=mapped.title,
        paths=_paths(mapped.recording, run),
        scans=_scan_records(mapped),
        blocks=run.blocks,
        verdicts=[] if found is None else found.trust.verdicts,
        calibration={} if found is None else found.calibration.by_name,
        facts=_facts(mapped.recording, run),
        parameters=mapped.parameters.to_mapping(),
        uncertainty=None if found is None else _uncertainty(found),
        errors=errors,
        further=run.further,
    )


def _paths(recording: Recording, run: Run) -> List[Path]:
    """Return all paths: the odometry first, the best one last."""
    paths = [Path(LABELS[name], COLORS[name], run.times, poses) for name, poses in run.poses.items()]
    if recording.truth is not None:
        positions = aligned_truth(run.times, run.poses[ODOMETRY], recording.truth)
        paths.insert(1, Path("truth", TRUTH_COLOR, recording.truth.times, positions))
    return paths


def _uncertainty(found: Found) -> Uncertainty:
    deviations = found.trust.deviations
    return Uncertainty(deviations.times, deviations.covariances, found.trust.doubtful)


def _facts(recording: Recording, run: Run) -> Dict[str, str]:
    minutes = recording.seconds / 60.0
    best = list(run.poses.values())[-1]
    way = float(np.hypot(*np.diff(best[:, :2], axis=0).T).sum())
    counts = run.counts
    return {
        "duration": f"{minutes:.1f} minutes",
        "way": f"{way:.0f} m",
        "beams": f"{len(recording.beams)}, and {recording.unplaced} that could not be placed",
        "scans": f"{counts['scans']}: {counts['matched']} matched, {counts['rejected']} rejected",
        "map": f"{counts['blocks']} blocks, cells of {run.blocks.resolution:g} m",
    }


def _scan_records(mapped: MappedBag) -> List[ScanRecord]:
    stamps = np.array([placed.beam.stamp_ns for placed in mapped.recording.beams]) * 1e-9
    pace = float(np.median(np.diff(stamps))) if len(stamps) > 1 else np.inf
    records, before = [], 0
    for update in mapped.replayed.updates:
        after = int(np.searchsorted(stamps, update.scan.reference_time, side="right"))
        points = _in_map(update.scan, mapped)
        missing = _missing(stamps[before:after], pace)
        records.append(ScanRecord(update.scan.reference_time, points, after - before, missing, _rejection(update)))
        before = after
    return records


def _missing(stamps: np.ndarray, pace: float) -> int:
    """Return how many beams did not come, where the head sends one every `pace` seconds."""
    if not 0.0 < pace < np.inf:
        return 0
    return int(np.maximum(np.round(np.diff(stamps) / pace) - 1.0, 0.0).sum())


def _rejection(update: ScanUpdate) -> str:
    if update.accepted:
        return ""
    return update.result.reason or update.result.status.value if update.result is not None else "no match was made"


def _in_map(scan: Scan, mapped: MappedBag) -> np.ndarray:
    """Return the points (n, 2) of a scan where the best path says that they are."""
    solver, run = mapped.replayed.solver, mapped.run
    if solver is not None:
        state = solver.state if mapped.refined is None else mapped.refined.batch.state
        return drawn(solver.log, solver.odometry, state, scan.points, scan.times)[:, :2]
    best = list(run.poses.values())[-1]
    poses = np.column_stack([np.interp(scan.times, run.times, best[:, 0]), np.interp(scan.times, run.times, best[:, 1]),
                             np.interp(scan.times, run.times, np.unwrap(best[:, 2]))])  # fmt: skip
    return transformed(composed(poses, inverse(scan.track.at(scan.times))), scan.points)[:, :2]
