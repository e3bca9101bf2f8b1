"""A recording as map_bag takes it, read from a bag of any kind."""

from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Callable, Dict, Iterable, Iterator, List, Optional, Tuple

import numpy as np

from mlsm_manager.scan_matching.scan import Scan, Track
from node_support.errors import RefusedInput, counted
from node_support.geometry import bearings_of, inverse, matrices, move_of, transformed
from node_support.headers import DAY
from recordings.bags.bag import RecordingError
from recordings.beams import RecordedBeams
from recordings.motion.frame_tree import FrameTree
from recordings.reader import Request, read
from sonar_processing.beams.beam import Beam, PlacedBeam
from sonar_processing.beams.parameters import BeamCorrection
from sonar_processing.cloud import Cloud
from sonar_processing.filters.echo_extractor import FEWEST_BEAMS, EchoExtractor
from sonar_processing.scans.assembler import turns_of
from sonar_processing.scans.parameters import SonarToCloudParameters
from sonar_processing.scans.polar_scan import PolarScan

# s of odometry around the end of a scan: the slowest turn of a head, and the largest sonar_delay.
_BEFORE, _AFTER = 60.0, 10.0
_DAY_NS = round(DAY * 1e9)


@dataclass(frozen=True)
class Truth:
    """Where the vehicle was by another instrument. times: (t,) s, increasing. positions: (t, 2) x y [m]."""

    times: np.ndarray
    positions: np.ndarray


@dataclass(frozen=True)
class Recording:
    """beams: in the order of their stamps, placed in odom. unplaced: number of beams that tf could not place.

    track: T_odom_base over the whole recording. seconds: its length. notes: what was assumed, as sentences.
    soundings: (n, 2) s and m below the vehicle.
    """

    beams: List[PlacedBeam]
    unplaced: int
    track: Track
    truth: Optional[Truth]
    notes: List[str] = field(default_factory=list)
    soundings: np.ndarray = field(default_factory=lambda: np.empty((0, 2)))

    def corrected(self, correction: BeamCorrection) -> "Recording":
        """Return the recording with all beams corrected, each placed by the odometry at its new stamp.

        Beams that the track does not reach then count as unplaced; depth and tilt of the others stay.
        """
        if correction == BeamCorrection():
            return self
        times = self.times
        later = times + correction.sonar_delay
        reached = (later >= self.track.times[0]) & (later <= self.track.times[-1])
        moves = matrices(move_of(self.track.at(times), self.track.at(later)))
        beams = [
            PlacedBeam(correction.corrected(placed.beam), move @ placed.T_target_sonar, placed.is_moving)
            for placed, move, kept in zip(self.beams, moves, reached)
            if kept
        ]
        return replace(self, beams=beams, unplaced=self.unplaced + len(self.beams) - len(beams))

    def with_track(self, track: Track) -> "Recording":
        """Return the recording with another T_odom_base, which the beams follow."""
        moves = matrices(move_of(self.track.at(self.times), track.at(self.times)))
        return replace(self._moved(moves), track=track)

    def _moved(self, moves: np.ndarray) -> "Recording":
        """Return the recording with its beams moved in odom, each by one of `moves` (n, 4, 4)."""
        pairs = zip(self.beams, moves)
        beams = [replace(placed, T_target_sonar=move @ placed.T_target_sonar) for placed, move in pairs]
        return replace(self, beams=beams)

    def without_beams(self, begin: float, end: float) -> "Recording":
        """Return the recording without the beams between two times [s]; they count as unplaced."""
        beams = [placed for placed in self.beams if not begin < placed.beam.stamp_ns * 1e-9 < end]
        return replace(self, beams=beams, unplaced=self.unplaced + len(self.beams) - len(beams))

    def without_positions(self) -> "Recording":
        """Return the recording as a compass alone makes it."""
        poses = self.track.poses
        return self.with_track(self.track.with_poses(poses * [0.0, 0.0, 1.0])) if poses[:, :2].any() else self

    def mounted(self, turn: float, is_over: bool) -> "Recording":
        """Return the recording with the sonar turned by `turn` [rad] in base_link where it is, and the other way round
        where `is_over`.
        """
        poses = self.track.at(self.times)
        about = np.append(self.sonar_in_base, turn)
        over = np.diag([1.0, -1.0, -1.0, 1.0]) if is_over else np.eye(4)
        move = matrices(about[np.newaxis])[0] @ over @ matrices(inverse(np.append(about[:2], 0.0))[np.newaxis])[0]
        return self._moved(matrices(poses) @ move @ matrices(inverse(poses)))

    @property
    def sent(self) -> List[Beam]:
        """The beams without where they are placed."""
        return [placed.beam for placed in self.beams]

    @property
    def times(self) -> np.ndarray:
        """(n,) s, when the beams left."""
        return np.array([beam.stamp_ns for beam in self.sent]) * 1e-9

    @property
    def sonar_in_base(self) -> np.ndarray:
        """(2,) x y [m] of the sonar in base_link, from the first beam."""
        first = self.beams[0]
        pose = self.track.at(first.beam.stamp_ns * 1e-9)
        return transformed(inverse(pose), first.T_target_sonar[np.newaxis, :2, 3])[0]

    @property
    def seconds(self) -> float:
        """From the first to the last of what was recorded, s."""
        return float(self.track.times[-1] - self.track.times[0])


def scans_of(recording: Recording, extractor: EchoExtractor) -> Iterator[Tuple[Scan, int]]:
    """Yield one scan of echoes per turn or sweep of the head, with its number of beams; see clouds_with_odometry."""

    def echoes() -> Iterator[Tuple[Cloud, int]]:
        cloud = SonarToCloudParameters()
        for turn in turns_of(recording.beams, FEWEST_BEAMS):
            with suppress(RefusedInput):
                yield extractor(PolarScan.of(turn).cloud(cloud)), len(turn)

    return clouds_with_odometry(recording, echoes())


def clouds_with_odometry(recording: Recording, clouds: Iterable[Tuple[Cloud, int]]) -> Iterator[Tuple[Scan, int]]:
    """Yield a scan for each cloud, with its number of beams.

    Its track begins a minute before its end, or where the scan before ended if that was earlier, and reaches 10 s
    beyond, for stamps that are to be moved.
    """
    before = np.inf
    for cloud, beams in clouds:
        end = cloud.stamp_ns * 1e-9
        track = track_between(recording.track, min(end - _BEFORE, before), end + _AFTER)
        before = end
        yield Scan.from_stamps(cloud.points, cloud.time_stamps, end, track), beams


def whole_turns(
    bag: Path, beams: int, found: Iterable[Tuple[Scan, int]], on_beams: Callable[[int], None] = lambda _: None
) -> List[Scan]:
    """Return the scans `found` in the `beams` of a bag; `on_beams` takes the number of beams of each.

    Raises RecordingError where there is none.
    """
    scans = []
    for scan, number in found:
        scans.append(scan)
        on_beams(number)
    if not scans:
        raise _no_turn(bag, beams)
    return scans


def _no_turn(path: Path, beams: int) -> RecordingError:
    heard = counted(beams, "beam")
    return RecordingError(f"{path}: no turn, sweep or part of one of which echoes can be told, in {heard}")


def track_between(track: Track, start: float, end: float) -> Track:
    """Return the part of a track that covers the times `start` to `end` [s], as far as it reaches."""
    first = max(int(np.searchsorted(track.times, start, side="right")) - 1, 0)
    last = min(int(np.searchsorted(track.times, end)) + 1, len(track.times))
    return track.chosen(slice(first, last))


def read_recording(path: Path, request: Request) -> Recording:
    """Return a recording; raises RecordingError for one that cannot be used."""
    content = read(path, request)
    tree, recorded = content.motion.tree, content.recorded
    stamps = tree.moving_stamps
    if not stamps.size:
        # A vehicle that never moves may have fixed transforms only.
        stamps = np.unique(recorded.stamps_ns)
        if len(stamps) < 2:
            raise _no_turn(path, len(recorded.beams))
    track = _track(tree, stamps, np.sort(recorded.stamps_ns), path, request)
    placed, unplaced = _placed(recorded, tree, path, request)
    known = content.truth
    truth = None if known is None else Truth(known.stamps_ns * 1e-9, known.translations[:, :2])
    return Recording(placed, recorded.refused + unplaced, track, truth, content.notes, recorded.soundings)


def _track(tree: FrameTree, stamps: np.ndarray, near_ns: np.ndarray, path: Path, request: Request) -> Track:
    """Return T_odom_base at those of `stamps` [ns] that are within a day of `near_ns`; others are damaged."""
    frames = request.motion.odom_frame, request.motion.base_frame
    poses, known = tree.poses(*frames, stamps)
    known &= (stamps >= near_ns[0] - _DAY_NS) & (stamps <= near_ns[-1] + _DAY_NS)
    if np.count_nonzero(known) < 2:
        reason = tree.why_not(*frames, stamps) or "a single stamp"
        raise RecordingError(f"{path}: no odometry, tf from {frames[1]} to {frames[0]}: {reason}")
    poses = poses[known]
    yaws = bearings_of(poses[..., 0])
    return Track(stamps[known] * 1e-9, np.column_stack([poses[:, :2, 3], yaws]))


def _placed(recorded: RecordedBeams, tree: FrameTree, path: Path, request: Request) -> Tuple[List[PlacedBeam], int]:
    """Return the beams with their places, in the order of their stamps, and how many have none."""
    odom, stamps = request.motion.odom_frame, recorded.stamps_ns
    of_frame: Dict[str, List[int]] = {}
    for index, beam in enumerate(recorded.beams):
        of_frame.setdefault(beam.frame_id, []).append(index)
    placed = {}
    for frame, indices in of_frame.items():
        poses, known = tree.poses(odom, frame, stamps[indices])
        for index, pose, is_known in zip(indices, poses, known):
            if is_known:
                placed[index] = PlacedBeam(recorded.beams[index], pose, recorded.moving[index])
    if not placed:
        reason = tree.why_not(odom, recorded.beams[0].frame_id, stamps)
        raise RecordingError(f"{path}: none of {len(stamps)} beams could be placed in {odom}: {reason}")
    order = sorted(placed, key=lambda index: (stamps[index], index))
    return [placed[index] for index in order], len(stamps) - len(placed)
