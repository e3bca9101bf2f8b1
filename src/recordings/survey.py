"""Everything that can be said of a recording before it is mapped, and the same in words."""

import re
import shlex
from dataclasses import dataclass
from itertools import groupby, islice
from pathlib import Path
from typing import Dict, List, Optional, Sequence

import numpy as np
from scipy.ndimage import median_filter

from node_support.errors import counted
from node_support.geometry import FULL_TURN, wrapped
from recordings.bags.bag import Bag, Topic
from recordings.bags.topic_roles import Role, with_role
from recordings.beams import RecordedBeams, beam_topic, beams_of_bag
from recordings.makers_logs import is_makers_log, makers_beams
from recordings.motion.frame_tree import FrameTree, frame_tree
from recordings.motion.pose_track import PoseTrack
from recordings.motion.sweep_shifts import sweep_shifts
from recordings.motion.vehicle_motion import Motion, MotionSource
from recordings.reader import Request, bag_of_beams, motion_for, mounted, tried
from sonar_processing.beams.beam import Beam, PlacedBeam
from sonar_processing.scans.assembler import turns_of

_NED = re.compile(r"(^|[_/])(ned|frd)($|[_/])")
_IMU_MESSAGES = 200  # that are looked at; a vehicle does not pitch for that long
_HALF_GRAVITY = 4.9  # m/s^2, as a level vehicle's z axis feels it

_DECLARED = {MotionSource.STANDING: "--standing", MotionSource.UNKNOWN: "--unknown-motion"}
_SHOWN = (Role.BEAMS, Role.ODOMETRY, Role.HEADING, Role.DEPTH, Role.VELOCITY, Role.POSITION)


@dataclass(frozen=True)
class Survey:
    """What a recording holds.

    kind: of the file, in words. topics: by their roles, the likeliest first. tree: tf as recorded. beams: topic that
    would be used, or None. heard: what its beams are. z_down: signs of it. heard, assumed, missing: sentences.
    """

    path: Path
    kind: str
    topics: Dict[Role, List[Topic]]
    tree: FrameTree
    beams: Optional[str]
    heard: List[str]
    z_down: List[str]
    assumed: List[str]
    missing: List[str]


def survey(path: Path, request: Request) -> Survey:
    """Return what a recording holds and lacks for a request.

    Raises RecordingError only for a file that cannot be read.
    """
    if is_makers_log(path):
        missing: List[str] = []
        recorded, kind = makers_beams(path), "a log or table of beams"
        motion = tried(missing, lambda: motion_for(path, None, request))
        assumed = _assumed(motion, recorded, request, missing)
        return Survey(path, kind, {}, FrameTree(), None, beam_lines(recorded), [], assumed, missing)
    with bag_of_beams(path) as bag:
        return _survey_of_bag(path, bag, request)


def _survey_of_bag(path: Path, bag: Bag, request: Request) -> Survey:
    tree = frame_tree(bag)
    missing: List[str] = []
    topic = tried(missing, lambda: beam_topic(bag, request.beams))
    motion = tried(missing, lambda: motion_for(path, bag, request))
    recorded = RecordedBeams([], []) if topic is None else beams_of_bag(bag, topic, request.parameters)
    assumed = _assumed(motion, recorded, request, missing)
    if topic is not None and not recorded.beams:
        missing.append(f"a beam: none of {recorded.refused} messages of {topic} holds one")
    signs = _signs_of_z_down(bag, tree.frames)
    if signs and not request.motion.z_is_down:
        assumed.append("the odometry counts x, y left, z up; if it counts north, east, down, give --ned")
    topics = {role: with_role(bag.topics, role) for role in Role}
    heard = beam_lines(recorded) if recorded.beams else []
    return Survey(path, f"a bag of ROS {2 if bag.is_ros2 else 1}", topics, tree, topic, heard, signs, assumed, missing)


def _assumed(motion: Optional[Motion], recorded: RecordedBeams, request: Request, missing: List[str]) -> List[str]:
    """Return what is assumed of motion and beams, and add to what is missing."""
    assumed = [*(motion.notes if motion is not None else []), *recorded.notes]
    if motion is None or not recorded.beams:
        return assumed
    tree, notes = mounted(motion.tree, request.motion.base_frame, recorded, request.parameters)
    assumed += notes
    beam, names = recorded.beams[0], request.motion
    link = tree.tracks.get((names.odom_frame, names.base_frame))
    if link is not None and not link.covers(np.array([beam.stamp_ns])).any():
        reason = tree.why_not(names.odom_frame, beam.frame_id, np.array([beam.stamp_ns]))
        assumed.append(f"the first beams are left out: {reason}")
    if tree.links_between(names.odom_frame, beam.frame_id) is None:
        missing.append(f"no transforms link {beam.frame_id} and {names.odom_frame}")
    return assumed


def _signs_of_z_down(bag: Bag, frames: List[str]) -> List[str]:
    """Return one sentence for each sign that frames count north, east, down, or forward, right, down."""
    named = [name for name in [*frames, *bag.topics] if _NED.search(name.lower())]
    signs = [f"{', '.join(sorted(named))}: named so"] if named else []
    for topic in with_role(bag.topics, Role.HEADING):
        felt = _gravity(bag, topic.name)
        if felt is not None and felt < -_HALF_GRAVITY:
            signs.append(f"{topic.name} feels gravity along -z, {felt:.1f} m/s2: its frame has z down")
    return signs


def _gravity(bag: Bag, topic: str) -> Optional[float]:
    """Return what the z axis of an Imu feels on average, m/s^2; None for another type or without messages."""
    some = (message for _, message in islice(bag.messages(topic), _IMU_MESSAGES))
    found = [one.linear_acceleration.z for one in some if hasattr(one, "linear_acceleration")]
    known = [value for value in found if np.isfinite(value)]
    return float(np.mean(known)) if known else None


def report(survey: Survey, request: Request) -> str:
    """Return what a bag holds, what will be assumed, what is missing, and a command line to start with."""
    sections = {"heard": survey.heard or ["nothing"]}
    for role in _SHOWN if survey.topics else ():
        topics = [f"{topic.name} ({topic.type}, {topic.count} messages)" for topic in survey.topics[role]]
        sections[role.value] = topics or ["none"]
    if survey.topics:
        tracks = sorted(survey.tree.tracks.items())
        links = [f"{parent} -> {child}: {_known_time(track)}" for (parent, child), track in tracks]
        sections.update({"frames": links or ["none"], "signs of z down": survey.z_down or ["none"]})
    sections.update(assumed=survey.assumed or ["nothing"], missing=survey.missing or ["nothing"])
    if not survey.missing:
        sections["start with"] = [_command(survey, request)]
    lines = [f"{survey.path}: {survey.kind}"]
    for title, told in sections.items():
        lines += [f"{title}:", *(f"    {line}" for line in told)]
    return "\n".join(lines)


def _known_time(track: PoseTrack) -> str:
    if track.is_fixed:
        return "fixed"
    first, last = track.stamps_ns[[0, -1]] * 1e-9
    return f"{len(track)} poses from {first:.2f} to {last:.2f} s"


def _command(survey: Survey, request: Request) -> str:
    motion = request.motion
    words = ["rosrun", "underwater_map_construction", "map_bag", str(survey.path), "--out", f"{survey.path.stem}_map"]
    words += ["--refine"]
    words += ["--beams", survey.beams] if survey.beams else []
    words += ["--vehicle", str(request.vehicle)] if request.vehicle else []
    words += ["--offset", f"{request.offset:g}"] if request.offset else []
    words += ["--odometry-topic", motion.odometry] if motion.odometry else []
    words += [_DECLARED[motion.declared]] if motion.declared is not None else []
    words += ["--ned"] if motion.z_is_down else []
    words += ["--odom-frame", motion.odom_frame] if motion.odom_frame != "odom" else []
    words += ["--base-frame", motion.base_frame] if motion.base_frame != "base_link" else []
    return " ".join(shlex.quote(word) for word in words)


_GAP = 1.0  # s: longer than any head takes for a beam
_STEPS_AROUND = 5
_WHOLE = 0.9  # share of a circle from which on a sweep counts as a turn: beams may be lost
_MOST_SETTINGS = 6  # of one kind that are listed


def beam_lines(recorded: RecordedBeams) -> List[str]:
    """Return sentences on all beams of a recording, at least one."""
    beams = sorted(recorded.beams, key=lambda beam: beam.stamp_ns)
    start, end = beams[0].stamp_ns, beams[-1].stamp_ns
    refused = counted(recorded.refused, "message")
    lost = f"; {refused} damaged or without a beam" if recorded.refused else ""
    shifts = sweep_shifts(beams)
    return [
        f"{counted(len(beams), 'beam')} in {(end - start) * 1e-9:.1f} s{lost}",
        *_head(beams),
        *_settings(beams, recorded),
        _gaps(np.array([beam.stamp_ns for beam in beams])),
        f"motion as sweeps show it: {shifts.motion.value}; {shifts}",
    ]


def _head(beams: List[Beam]) -> List[str]:
    turns = turns_of([PlacedBeam(beam, np.eye(4), is_moving=False) for beam in beams], fewest=2)
    angles = [np.array([one.beam.angle for one in turn]) for turn in turns]
    moved = [np.abs(wrapped(np.diff(one))) for one in angles]
    if not any(one.any() for one in moved):
        return ["the head stood still"]
    swept = np.array([one.sum() for one in moved])
    is_turn = swept >= _WHOLE * FULL_TURN
    told = [counted(is_turn.sum(), "whole turn")] if is_turn.any() else []
    if not is_turn.all():
        told.append(f"{counted((~is_turn).sum(), 'sweep')} of {np.degrees(np.median(swept[~is_turn])):.0f} degrees")
    return [f"the head made {' and '.join(told)}"]


def _settings(beams: List[Beam], recorded: RecordedBeams) -> List[str]:
    stamps = [beam.stamp_ns for beam in beams]
    ranges = [f"{round(len(beam.ranges) * beam.range_resolution, 1):g} m in {len(beam.ranges)} bins" for beam in beams]
    steps = np.degrees(np.abs(wrapped(np.diff([beam.angle for beam in beams]))))
    # Where the head turns back, or a beam was lost, one step is another.
    steps = median_filter(steps, _STEPS_AROUND, mode="nearest")
    found = [_since("range", ranges, stamps)]
    if steps.any():
        found.append(_since("step", [f"{step:.2g} degrees" for step in steps], stamps))
    if recorded.gains:
        found.append(_since("gain", [str(gain) for gain in recorded.gains], list(recorded.stamps_ns)))
    return found


def _since(name: str, told: Sequence[str], stamps_ns: Sequence[int]) -> str:
    alike = groupby(zip(told, stamps_ns), key=lambda one: one[0])
    found = [f"{one} from {(next(run)[1] - stamps_ns[0]) * 1e-9:.1f} s" for one, run in alike]
    more = f", and {len(found) - _MOST_SETTINGS} changes more" if len(found) > _MOST_SETTINGS else ""
    return f"{name}: {', '.join(found[:_MOST_SETTINGS])}{more}"


def _gaps(stamps_ns: np.ndarray) -> str:
    seconds = np.diff(stamps_ns) * 1e-9
    gaps = seconds[seconds > _GAP]
    if not gaps.size:
        return f"no gap longer than {_GAP:g} s"
    at = (stamps_ns[int(np.argmax(seconds))] - stamps_ns[0]) * 1e-9
    return f"{counted(len(gaps), 'gap')} longer than {_GAP:g} s, the longest {gaps.max():.1f} s after {at:.1f} s"
