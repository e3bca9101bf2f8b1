"""What a recording tells of its odometry, and the parameters that suit it."""

from typing import Collection, Dict, NamedTuple, Optional, Sequence

import numpy as np

from mlsm_manager.joint_solver.map_support import shares_heard_before
from mlsm_manager.joint_solver.solution import Solution
from mlsm_manager.localisation.odometry_profiles import OdometryKind, profile_values
from mlsm_manager.odometry.continuous import ReportedMotion
from mlsm_manager.offline.recording import Recording
from mlsm_manager.offline.replay import ReplayParameters
from mlsm_manager.scan_matching.scan import Scan
from mlsm_manager.self_check.causes import NOTHING_ASSUMED, Assumption
from mlsm_manager.self_check.map_checks import scans_go_on
from mlsm_manager.self_check.verdict import Answer
from recordings.motion.sweep_shifts import SweepMotion, SweepShifts, sweep_shifts

_CELLS = 40
"""Cells of the map from the vehicle to its far echoes: so many can be told apart in map.png, fewer make a tank a few
squares."""
_NEARLY_ALL = 0.95  # of the echoes; a few far ones are noise
_SMALLEST_CELL = 0.05
"""m: what the echoes of a Ping360 at its shortest range are long."""
_WORTH_TRYING = 0.75
"""Share of scans that go on, below which a second mapping is worth its time. Simulated tours ahead have 0.85 and more,
strafing ones 0.57 and 0.66."""
_CLEARLY = 0.03
"""Share of the echoes that go on once positions are left out: .04 and more where these make no sense, else .01."""
_SHORTER = 0.1
"""The same on a path that is shorter than by the positions: its scans lie on each other more, whatever is true: by .05
in a canal."""

# A pose that is known to stay; one that seems to, by echoes that do not tell all directions as well: 5 mm/s, which they
# hold back where they tell; and one that drifts as a head on a cable or a moored vehicle: 0.05 m/s for a minute.
_STILL = {
    "scale_deviation": 0.0, "direction_deviation": 0.0, "speed_deviation": 1e-4, "heading_deviation": 1e-3,
}  # fmt: skip
_SEEMS_STILL = {**_STILL, "speed_deviation": 0.005, "rate_correlation_time": 60.0}
_DRIFTING = {
    **_STILL, "speed_deviation": 0.05, "rate_correlation_time": 60.0, "heading_deviation": 0.0,
    "turn_rate_deviation": 0.003,
}  # fmt: skip
# A log does not tell where the head is mounted: as far as is known the vehicle slips as fast as it goes ahead.
_ANYWHERE = {"slip_deviation": 0.2, "slip_correlation_time": 40.0}
_WITHOUT_MOTION: Dict[Optional[SweepMotion], Dict[str, float]] = {
    SweepMotion.STILL: _SEEMS_STILL,
    SweepMotion.UNTOLD: _STILL,
    SweepMotion.DRIFTING: _DRIFTING,
    SweepMotion.MOVING: _ANYWHERE,
}


class OdometryFound(NamedTuple):
    """kind: of the odometry. reason: one line that says why. motion: what sweeps tell where nothing was recorded.

    is_said: somebody says that the vehicle stood still. put_right: what that rests on, where echoes told to do it.
    """

    kind: OdometryKind
    reason: str
    motion: Optional[SweepMotion] = None
    is_said: bool = False
    put_right: Assumption = NOTHING_ASSUMED

    @property
    def name(self) -> str:
        if self.motion in (None, SweepMotion.MOVING):
            return self.kind.value.lower()
        names = {SweepMotion.STILL: "standing", SweepMotion.DRIFTING: "drifting"}
        return names.get(self.motion, "not told, held still")

    @property
    def assumed(self) -> Assumption:
        """What the path rests on though nothing was measured of it; empty where something was."""
        if self.motion is SweepMotion.UNTOLD:
            return Assumption("the vehicle stood still, which nothing tells")
        return self.put_right


def odometry_of(recording: Recording, standing: bool = False) -> OdometryFound:
    """Return what a recording tells of the vehicle's motion: its T_odom_base, or the echoes where that never changes.

    standing: somebody says that the vehicle stood still.
    """
    motion = ReportedMotion()
    motion.learn(recording.track)
    if motion.has_positions:
        return OdometryFound(OdometryKind.AUTO, f"positions change by up to {motion.extent:.1f} m")
    if motion.has_headings:
        turned = np.degrees(motion.turned)
        return OdometryFound(OdometryKind.HEADING, f"the position never changes, the heading by {turned:.0f} degrees")
    return _without_motion(sweep_shifts(placed.beam for placed in recording.beams), standing)


def _without_motion(shifts: SweepShifts, standing: bool) -> OdometryFound:
    if standing:
        moves = shifts.motion in (SweepMotion.DRIFTING, SweepMotion.MOVING)
        doubt = f", but it seems to be {shifts.motion.value}: {shifts}" if moves else ""
        return OdometryFound(OdometryKind.DVL, f"--standing says so{doubt}", SweepMotion.STILL, is_said=True)
    kind = OdometryKind.NONE if shifts.motion is SweepMotion.MOVING else OdometryKind.DVL
    return OdometryFound(kind, f"no position or heading changes, and {shifts}", shifts.motion)


def with_odometry(
    parameters: ReplayParameters, kind: OdometryKind, fixed: Collection[str], motion: Optional[SweepMotion] = None,
    is_said: bool = False,
) -> ReplayParameters:  # fmt: skip
    """Return `parameters` with the profile of an odometry, but for those that are `fixed`.

    motion: what sweeps tell where the odometry tells none. is_said: somebody says that the vehicle stood still.
    """
    values = {**profile_values(kind), **(_STILL if is_said else _WITHOUT_MOTION.get(motion, {}))}
    return parameters.changed({key: value for key, value in values.items() if key not in fixed})


def with_cells(parameters: ReplayParameters, scans: Sequence[Scan], fixed: Collection[str]) -> ReplayParameters:
    """Return `parameters` with smaller cells where nearly all echoes lie within 20 m of the vehicle, if not `fixed`."""
    if "resolution" in fixed:
        return parameters
    distances = [np.hypot(*(scan.points[:, :2] - scan.track.at(scan.times)[:, :2]).T) for scan in scans]
    reach = float(np.quantile(np.concatenate(distances), _NEARLY_ALL)) if any(map(len, distances)) else np.inf
    cell = max(round(reach, 1) / _CELLS, _SMALLEST_CELL)
    return parameters.changed({"resolution": min(cell, parameters.resolution)})


def goes_on(run: Solution) -> Answer:
    """Return whether scans go on in a run that is solved as if the vehicle goes ahead, or as it reports."""
    return scans_go_on(run.log.node_times[1:], shares_heard_before(run, 0), _WORTH_TRYING).answer


def goes_on_better(believed: Solution, alone: Solution) -> bool:
    """Return whether scans go on in the run `alone`, and clearly better than in the one that is `believed`."""
    shares, others = (shares_heard_before(run, 0) for run in (alone, believed))
    gain = float(np.nanmean(shares) - np.nanmean(others))
    by_alone, by_believed = (float(np.hypot(*np.diff(run.places, axis=0).T).sum()) for run in (alone, believed))
    needed = _SHORTER if by_alone < by_believed else _CLEARLY
    return gain > needed and not scans_go_on(alone.log.node_times[1:], shares).fires
