"""A survey in words."""

import shlex
from typing import List

from recordings.inspection.survey import Survey
from recordings.messages.roles import Role
from recordings.reading.reader import Request
from recordings.transforms.pose_track import PoseTrack
from recordings.vehicle.motion import MotionSource

_NOTHING = "none"
_DECLARED = {MotionSource.STANDING: "--standing", MotionSource.UNKNOWN: "--unknown-motion"}
_SHOWN = (Role.BEAMS, Role.ODOMETRY, Role.HEADING, Role.DEPTH, Role.VELOCITY, Role.POSITION)


def report(survey: Survey, request: Request) -> str:
    """Return what a bag holds, what will be assumed, what is missing, and a command line to start with."""
    lines = [f"{survey.path}: a bag of ROS {2 if survey.is_ros2 else 1}"]
    for role in _SHOWN:
        told = [f"{topic.name} ({topic.type}, {topic.count} messages)" for topic in survey.topics[role]]
        lines += _section(role.value, told or [_NOTHING])
    links = [f"{parent} -> {child}: {_told(track)}" for (parent, child), track in sorted(survey.tree.tracks.items())]
    lines += _section("frames", links or [_NOTHING])
    lines += _section("signs of z down", survey.z_down or [_NOTHING])
    lines += _section("assumed", survey.assumed or ["nothing"])
    lines += _section("missing", survey.missing or ["nothing"])
    if not survey.missing:
        lines += _section("start with", [_command(survey, request)])
    return "\n".join(lines)


def _section(title: str, lines: List[str]) -> List[str]:
    return [f"{title}:", *(f"    {line}" for line in lines)]


def _told(track: PoseTrack) -> str:
    if track.is_fixed:
        return "fixed"
    first, last = track.stamps_ns[[0, -1]] * 1e-9
    return f"{len(track)} poses from {first:.2f} to {last:.2f} s"


def _command(survey: Survey, request: Request) -> str:
    motion = request.motion
    words = ["map_bag", str(survey.path), "--out", f"{survey.path.stem}_map", "--beams", survey.beams or ""]
    words += ["--odometry-topic", motion.odometry] if motion.odometry else []
    words += [_DECLARED[motion.declared]] if motion.declared is not None else []
    words += ["--ned"] if motion.z_is_down else []
    words += ["--odom-frame", motion.odom_frame] if motion.odom_frame != "odom" else []
    words += ["--base-frame", motion.base_frame] if motion.base_frame != "base_link" else []
    return " ".join(shlex.quote(word) for word in words)
