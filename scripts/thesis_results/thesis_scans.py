"""Simulated scans as the chain of thesis:=true makes them, and its estimator."""

from typing import List, Optional

from benchmarks.scans import Poses, ScanMaker, SonarKind, at_depth, head_turn

from mlsm_manager.localisation.estimator import Estimator
from mlsm_manager.offline.recording import Recording
from mlsm_manager.offline.replay import ReplayParameters, replay_values
from mlsm_manager.offline.thesis_chain import ThesisChain, thesis_values
from mlsm_manager.scan_matching.scan import Scan, Track
from sonar_processing.beams.beam import Beam, PlacedBeam

CHAIN = ThesisChain.from_values(thesis_values({}))
DEFAULTS = ThesisChain.from_values({})
"""The same chain with the defaults of the package."""
PARAMETERS = ReplayParameters.from_mapping(replay_values(thesis_values({}))[0])
_LATER = 1000.0  # s: stamps of messages are above 0


class ThesisScans(ScanMaker):
    """Makes scans of cleaned points; see ScanMaker."""

    def __init__(self, kind: SonarKind) -> None:
        super().__init__("basin", kind)

    def scan(
        self, true_pose: Poses, odometry: Poses, seed: int, turn: int = 0, moving: bool = False,
        track: Optional[Track] = None,
    ) -> Scan:  # fmt: skip
        """Return the scan of head turn number `turn`, its points placed by the odometry."""
        times, angles = head_turn(turn)
        sonar = self.sonar(seed)
        strengths = sonar.pings(at_depth(true_pose(times)), angles)
        beams: List[PlacedBeam] = []
        for time, angle, heard, place in zip(times, angles, strengths, at_depth(odometry(times))):
            stamp = round(1e9 * (time + _LATER))
            beam = Beam(stamp, "sonar", float(angle), heard, sonar.range_resolution, bin_place=CHAIN.clouds.bin_place)
            beams.append(PlacedBeam(beam, place, moving))
        known = Track(times, odometry(times)) if track is None else track
        later = Track(known.times + _LATER, known.poses)
        made, _ = next(CHAIN.scans(Recording(beams, 0, later, None)))
        return Scan(made.points, made.times - _LATER, made.moving, known, float(times[-1]))


def thesis_estimator() -> Estimator:
    """Return an estimator with an empty map and the parameters of yaml/thesis.yaml."""
    return PARAMETERS.build_localiser().estimator


def fine_estimator() -> Estimator:
    """Return the same with cells of 0.3 m, the default of the code of 2015."""
    return PARAMETERS.changed({"resolution": 0.3, "match_resolution": 0.3}).build_localiser().estimator
