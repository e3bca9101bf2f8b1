"""Breaks recordings: one function for each thing that goes wrong at sea; recording and seed in, recording out.

Faults begin at `at` seconds after the first pose. Positions are re-integrated where a fault of heading or speed would
have bent them.
"""

from dataclasses import replace
from typing import Callable, Optional

import numpy as np

from mlsm_manager.odometry.changed_tracks import integrated
from mlsm_manager.offline.recording import Recording
from mlsm_manager.scan_matching.scan import Track
from node_support.geometry import matrices, move_of, seen_from
from sonar_processing.beams.beam import Beam, PlacedBeam

Fault = Callable[[Recording], Recording]
_LOUDEST = 127  # the sonars' own largest strength


def with_odometry(recording: Recording, poses: np.ndarray) -> Recording:
    """Return a recording of which the odometry said `poses` (m, 3)."""
    return recording.with_track(recording.track.with_poses(poses))


def after(recording: Recording, at: float) -> np.ndarray:
    """Return which poses (m,) are `at` seconds or more after the first one."""
    return recording.track.times - recording.track.times[0] >= at


def steps_of(poses: np.ndarray) -> np.ndarray:
    return seen_from(poses[:-1], poses[1:])


def odometry_restarts(recording: Recording, at: float) -> Recording:
    """Let the odometry begin again at zero."""
    poses, later = recording.track.poses.copy(), after(recording, at)
    poses[later] = seen_from(poses[later][:1], poses[later])
    return with_odometry(recording, poses)


def odometry_jumps(recording: Recording, at: float, size: float, every: float = np.inf, seed: int = 1) -> Recording:
    """Let positions jump by `size` metres to a random side, once or `every` so many seconds."""
    poses, rng = recording.track.poses.copy(), np.random.RandomState(seed)
    last = recording.seconds
    for moment in np.arange(at, last, every) if np.isfinite(every) else [at]:
        angle = rng.uniform(-np.pi, np.pi)
        poses[after(recording, moment), :2] += size * np.array([np.cos(angle), np.sin(angle)])
    return with_odometry(recording, poses)


def odometry_glitches(recording: Recording, at: float, size: float, samples: int = 1) -> Recording:
    """Let some poses lie `size` metres beside the others, which go on as before."""
    poses, first = recording.track.poses.copy(), int(np.argmax(after(recording, at)))
    poses[first : first + samples, 0] += size
    return with_odometry(recording, poses)


def odometry_freezes(recording: Recording, at: float, seconds: float = np.inf, goes_on: bool = True) -> Recording:
    """Let the pose stay for some seconds; then it goes on from there (`goes_on`), or where the vehicle is by then."""
    poses, stands = recording.track.poses, after(recording, at) & ~after(recording, at + seconds)
    if not goes_on:
        frozen = poses.copy()
        frozen[stands] = frozen[np.argmax(stands)]
        return with_odometry(recording, frozen)
    steps = steps_of(poses)
    steps[stands[1:]] = 0.0
    return with_odometry(recording, integrated(poses[0], steps))


def odometry_hangs(recording: Recording, at: float, seconds: float) -> Recording:
    """Let the pose stay for some seconds; then the heading is right, and positions go on from where they stood."""
    poses, stands = recording.track.poses.copy(), after(recording, at) & ~after(recording, at + seconds)
    moves = np.diff(poses[:, :2], axis=0) * ~stands[1:, np.newaxis]
    poses[1:, :2] = poses[0, :2] + np.cumsum(moves, axis=0)
    poses[stands, 2] = poses[np.argmax(stands), 2]
    return with_odometry(recording, poses)


def odometry_missing(recording: Recording, at: float, seconds: float) -> Recording:
    """Leave out the odometry of some seconds, and with it the beams that cannot be placed then."""
    start, track = recording.track.times[0] + at, recording.track
    kept = (track.times < start) | (track.times > start + seconds)
    known = (recording.times < start) | (recording.times > start + seconds)
    beams = [placed for placed, one in zip(recording.beams, known) if one]
    return replace(recording, track=Track(track.times[kept], track.poses[kept]), beams=beams)


def odometry_scaled(recording: Recording, factor: float, at: float = 0.0) -> Recording:
    """Let reported distances be `factor` times as long from a moment on."""
    steps = steps_of(recording.track.poses)
    steps[after(recording, at)[1:], :2] *= factor
    return with_odometry(recording, integrated(recording.track.poses[0], steps))


def dvl_turned(recording: Recording, degrees: float) -> Recording:
    """Let the DVL be mounted turned: reported moves are turned against the vehicle, headings are not."""
    steps = steps_of(recording.track.poses)
    moves = (steps[:, 0] + 1j * steps[:, 1]) * np.exp(1j * np.radians(degrees))
    steps[:, :2] = np.column_stack([moves.real, moves.imag])
    return with_odometry(recording, integrated(recording.track.poses[0], steps))


def with_compass_error(recording: Recording, error: np.ndarray, positions_follow: bool = True) -> Recording:
    """Add `error` (m,) [rad] to the heading; `positions_follow`: positions are integrated with the wrong heading."""
    poses = recording.track.poses + error[:, np.newaxis] * [0.0, 0.0, 1.0]
    if not positions_follow:
        return with_odometry(recording, poses)
    steps = steps_of(recording.track.poses)
    steps[:, 2] = np.diff(poses[:, 2])
    return with_odometry(recording, integrated(poses[0], steps))


def compass_steps(recording: Recording, at: float, degrees: float, positions_follow: bool = True) -> Recording:
    """Let the heading step once."""
    return with_compass_error(recording, np.radians(degrees) * after(recording, at), positions_follow)


def compass_drifts(recording: Recording, at: float, degrees_per_minute: float) -> Recording:
    """Let the heading drift from a moment on."""
    since = np.maximum(recording.track.times - recording.track.times[0] - at, 0.0)
    return with_compass_error(recording, np.radians(degrees_per_minute) * since / 60.0)


def compass_deviates(recording: Recording, degrees: float, times: int = 1) -> Recording:
    """Let the heading err as a sine of itself, `times` in a circle: hard iron 1, soft iron 2."""
    return with_compass_error(recording, np.radians(degrees) * np.sin(times * recording.track.poses[:, 2]))


def mounted(recording: Recording, T_sonar_told: np.ndarray) -> Recording:
    """Let tf tell another mount: T_base_told = T_base_sonar * T_sonar_told (4, 4)."""
    beams = [replace(one, T_target_sonar=one.T_target_sonar @ T_sonar_told) for one in recording.beams]
    return replace(recording, beams=beams)


def mount_turned(recording: Recording, degrees: float) -> Recording:
    """Let the sonar be mounted turned counter-clockwise against what tf says."""
    return mounted(recording, matrices(np.array([[0.0, 0.0, -np.radians(degrees)]]))[0])


def mount_upside_down(recording: Recording) -> Recording:
    """Let the sonar hang the other way round than tf says."""
    return mounted(recording, np.diag([1.0, -1.0, -1.0, 1.0]))


def mount_shifted(recording: Recording, metres: float) -> Recording:
    """Let the sonar sit ahead of where tf says, along the vehicle."""
    told = matrices(recording.track.at(recording.times))[:, :3, 0] * metres
    beams = []
    for placed, move in zip(recording.beams, told):
        place = placed.T_target_sonar.copy()
        place[:3, 3] -= move
        beams.append(replace(placed, T_target_sonar=place))
    return replace(recording, beams=beams)


def changed(
    recording: Recording, change: Callable[[Beam, int], Optional[Beam]], at: float = 0.0, seconds: float = np.inf
) -> Recording:
    """Return the recording with each beam of a stretch changed; those that become None are left out."""
    start, beams = recording.track.times[0] + at, []
    for number, placed in enumerate(recording.beams):
        if start <= placed.beam.stamp_ns * 1e-9 < start + seconds:
            changed = change(placed.beam, number)
            if changed is not None:
                beams.append(replace(placed, beam=changed))
        else:
            beams.append(placed)
    return replace(recording, beams=beams)


def head_slips(recording: Recording, at: float, degrees: float, every: float = np.inf) -> Recording:
    """Let the head slip against what it reports, once or `every` so many seconds."""
    start = recording.track.times[0] + at

    def slipped(beam: Beam, _: int) -> Beam:
        times = 1 + ((beam.stamp_ns * 1e-9 - start) // every if np.isfinite(every) else 0)
        return replace(beam, angle=beam.angle + times * np.radians(degrees))

    return changed(recording, slipped, at)


def head_stops(recording: Recording, at: float, seconds: float, tells: bool = True) -> Recording:
    """Let the head stand: it hears one direction; its reported angle stands too (`tells`) or goes on."""
    start = recording.track.times[0] + at
    angles = np.array([one.beam.angle for one in recording.beams])
    stands = angles[np.searchsorted(recording.times, start)]
    same = np.flatnonzero(np.abs(np.angle(np.exp(1j * (angles - stands)))) < 0.05)

    def stood(beam: Beam, number: int) -> Beam:
        heard = recording.beams[same[np.argmin(np.abs(same - number))]].beam.intensities
        return replace(beam, intensities=heard, angle=stands if tells else beam.angle)

    return changed(recording, stood, at, seconds)


def head_reversed(recording: Recording) -> Recording:
    """Let the head turn the other way than it reports."""
    return changed(recording, lambda beam, _: replace(beam, angle=-beam.angle))


def beams_stop(recording: Recording, at: float, seconds: float) -> Recording:
    """Leave out all beams of some seconds."""
    return changed(recording, lambda beam, _: None, at, seconds)


def beams_missing(recording: Recording, share: float, seed: int = 1) -> Recording:
    """Leave out a random share of the beams."""
    rng = np.random.RandomState(seed)
    return changed(recording, lambda beam, _: None if rng.uniform() < share else beam)


def range_changed(recording: Recording, at: float, factor: float) -> Recording:
    """Let the range setting become `factor` times as long, which the messages do not tell."""

    def stretched(beam: Beam, _: int) -> Beam:
        bins = np.arange(len(beam.intensities))
        heard = np.minimum((bins + 0.5) * factor, 1e9).astype(int)
        strengths = np.where(heard < len(bins), beam.intensities[np.minimum(heard, len(bins) - 1)], 0)
        return replace(beam, intensities=strengths.astype(np.uint8))

    return changed(recording, stretched, at)


def range_told(recording: Recording, at: float, share: float, seconds: float = np.inf) -> Recording:
    """Let the range setting become a share of itself for some seconds, told by the messages."""
    return changed(recording, lambda beam, _: replace(
        beam, intensities=beam.intensities[: int(share * len(beam.intensities))]
    ), at, seconds)  # fmt: skip


def gain_changed(recording: Recording, at: float, factor: float) -> Recording:
    """Let all strengths become `factor` times as large."""

    def louder(beam: Beam, _: int) -> Beam:
        return replace(beam, intensities=np.minimum(beam.intensities * factor, _LOUDEST).astype(np.uint8))

    return changed(recording, louder, at)


def echoes_longer(recording: Recording, at: float, bins: int) -> Recording:
    """Let each echo last `bins` longer, as with more gain or a longer pulse."""

    def longer(beam: Beam, _: int) -> Beam:
        strengths = beam.intensities.copy()
        for shift in range(1, bins + 1):
            strengths[shift:] = np.maximum(strengths[shift:], beam.intensities[:-shift])
        return replace(beam, intensities=strengths)

    return changed(recording, longer, at)


def half_blind(recording: Recording) -> Recording:
    """Let half of the circle hear nothing."""
    return changed(recording, lambda beam, _: replace(
        beam, intensities=beam.intensities * np.uint8(np.sin(beam.angle) > 0.0)
    ))  # fmt: skip


def deaf(recording: Recording, at: float, seconds: float = np.inf) -> Recording:
    """Let the sonar hear nothing."""
    return changed(recording, lambda beam, _: replace(beam, intensities=np.zeros_like(beam.intensities)), at, seconds)


def spikes(recording: Recording, share: float, at: float = 0.0, seed: int = 1) -> Recording:
    """Put a loud spike of two bins at a random range of a share of the beams."""
    rng = np.random.RandomState(seed)
    return changed(recording, lambda beam, _: _spiked(
        beam, rng.randint(20, len(beam.intensities) - 2) if rng.uniform() < share else None
    ), at)  # fmt: skip


def spiral(recording: Recording, at: float, bins_per_beam: float = 1.37) -> Recording:
    """Put an echo of another sonar into each beam, whose range moves evenly on from beam to beam."""
    return changed(recording, lambda beam, number: _spiked(
        beam, 20 + int(bins_per_beam * number) % (len(beam.intensities) - 22)
    ), at)  # fmt: skip


def _spiked(beam: Beam, place: Optional[int]) -> Beam:
    if place is None:
        return beam
    strengths = beam.intensities.copy()
    strengths[place : place + 2] = _LOUDEST
    return replace(beam, intensities=strengths)


def delayed(recording: Recording, seconds: float, growing: bool = False, at: float = 0.0) -> Recording:
    """Let stamps be later than the pings by some seconds, from a moment on; growing: from 0 at the start to these."""
    since = recording.times - recording.track.times[0]
    return stamped(recording, seconds * (since / recording.seconds if growing else since >= at))


def stamped(recording: Recording, late: np.ndarray) -> Recording:
    """Let stamps be later than the pings by `late` (n,) [s]: a late one places its beam where the vehicle is then."""
    track, beams = recording.track, []
    for placed, seconds in zip(recording.beams, late):
        time = placed.beam.stamp_ns * 1e-9
        if not track.times[0] <= time + seconds <= track.times[-1]:
            continue
        move = matrices(move_of(track.at(np.array([time])), track.at(np.array([time + seconds]))))[0]
        beam = replace(placed.beam, stamp_ns=round(1e9 * (time + seconds)))
        beams.append(PlacedBeam(beam, move @ placed.T_target_sonar, placed.is_moving))
    return replace(recording, beams=beams)
