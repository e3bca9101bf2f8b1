"""Breaks recordings in rarer ways than fault_makers: one function for each; recording in, recording out."""

from dataclasses import replace

import numpy as np

from benchmarks.fault_makers import after, changed, mounted, stamped, steps_of, with_compass_error, with_odometry
from mlsm_manager.odometry.changed_tracks import integrated
from mlsm_manager.offline.recording import Recording
from sonar_processing.beams.beam import Beam

_FULL = 255


def odometry_stalls(recording: Recording, seconds: float, every: float = 60.0) -> Recording:
    """Let the pose stay for some seconds each minute; then it goes on from there."""
    return _without_steps(recording, seconds, every, np.ones(3))


def velocities_missing(recording: Recording, seconds: float, every: float = 60.0) -> Recording:
    """Let positions stay for some seconds each minute, as where a DVL tells nothing, while the compass goes on."""
    return _without_steps(recording, seconds, every, np.array([1.0, 1.0, 0.0]))


def _without_steps(recording: Recording, seconds: float, every: float, columns: np.ndarray) -> Recording:
    since = recording.track.times - recording.track.times[0]
    steps = steps_of(recording.track.poses)
    steps[(since[1:] % every) < seconds] *= 1.0 - columns
    return with_odometry(recording, integrated(recording.track.poses[0], steps))


def odometry_noisy(recording: Recording, metres: float, seed: int = 1) -> Recording:
    """Let positions tremble, each by itself."""
    noise = metres * np.random.RandomState(seed).normal(size=recording.track.poses.shape) * [1.0, 1.0, 0.0]
    return with_odometry(recording, recording.track.poses + noise)


def odometry_senseless(recording: Recording, seed: int = 1) -> Recording:
    """Let speeds and turns be drawn at random, as of another vehicle: up to 0.3 m/s each way and 6 deg/s."""
    track = recording.track
    rates = np.cumsum(np.random.RandomState(seed).normal(size=(len(track.times) - 1, 3)), axis=0)
    rates *= np.array([0.3, 0.3, 0.1]) / np.abs(rates).max(axis=0)
    return with_odometry(recording, integrated(track.poses[0], rates * np.diff(track.times)[:, np.newaxis]))


def head_turns_twice(recording: Recording) -> Recording:
    """Let reported angles go round twice while the head goes round once."""
    return changed(recording, lambda beam, _: replace(beam, angle=2.0 * beam.angle))


def odometry_rounded(recording: Recording, metres: float, degrees: float = 1.0) -> Recording:
    """Let positions be rounded to some metres, and headings to some degrees, as in a log of text."""
    unit = np.array([metres, metres, np.radians(degrees)])
    return with_odometry(recording, np.round(recording.track.poses / unit) * unit)


def odometry_drifts(recording: Recording, at: float, speed: float, seconds: float = np.inf) -> Recording:
    """Let a current carry the vehicle that the odometry does not feel, as where a DVL has lost the bottom."""
    since = np.clip(recording.track.times - recording.track.times[0] - at, 0.0, seconds)
    return with_odometry(recording, recording.track.poses - speed * since[:, np.newaxis] * [0.8, 0.6, 0.0])


def odometry_mirrored(recording: Recording) -> Recording:
    """Let the odometry count z down: y and yaw have the other sign."""
    return with_odometry(recording, recording.track.poses * [1.0, -1.0, -1.0])


def odometry_late(recording: Recording, seconds: float) -> Recording:
    """Let poses come with stamps that are late."""
    track = recording.track
    return with_odometry(recording, track.at(track.times - seconds))


def compass_sticks(recording: Recording, at: float) -> Recording:
    """Let the heading stay as it is from a moment on; positions are integrated with it."""
    yaws, stuck = recording.track.poses[:, 2], after(recording, at)
    return with_compass_error(recording, np.where(stuck, yaws[np.argmax(stuck)] - yaws, 0.0))


def compass_noisy(recording: Recording, degrees: float, seed: int = 1) -> Recording:
    """Let the heading tremble; positions are right."""
    noise = np.radians(degrees) * np.random.RandomState(seed).normal(size=len(recording.track.times))
    return with_compass_error(recording, noise, positions_follow=False)


def compass_off(recording: Recording, degrees: float) -> Recording:
    """Let the heading be wrong all along, and positions be right: true north for magnetic, or a mount."""
    return with_compass_error(recording, np.full(len(recording.track.times), np.radians(degrees)), False)


def compass_reversed(recording: Recording, positions_follow: bool) -> Recording:
    """Let the heading count the other way; positions are right, or integrated with it."""
    return with_compass_error(recording, -2.0 * recording.track.poses[:, 2], positions_follow)


def mount_tilted(recording: Recording, degrees: float) -> Recording:
    """Let the sonar's plane be tilted against what tf says."""
    cos, sin = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    T_sonar_told = np.eye(4)
    T_sonar_told[:3, :3] = [[cos, 0.0, sin], [0.0, 1.0, 0.0], [-sin, 0.0, cos]]
    return mounted(recording, T_sonar_told)


def head_loses_steps(recording: Recording, degrees: float) -> Recording:
    """Let the head turn less than it reports, by some degrees each minute."""
    start, rate = recording.track.times[0], np.radians(degrees) / 60.0
    return changed(recording, lambda beam, _: replace(beam, angle=beam.angle + rate * (beam.stamp_ns * 1e-9 - start)))


def head_trembles(recording: Recording, degrees: float, seed: int = 1) -> Recording:
    """Let each reported angle be wrong by itself."""
    rng = np.random.RandomState(seed)
    return changed(recording, lambda beam, _: replace(beam, angle=beam.angle + np.radians(degrees) * rng.normal()))


def stamps_jitter(recording: Recording, seconds: float, seed: int = 1) -> Recording:
    """Let each stamp be wrong by itself; beams keep their order."""
    track, rng = recording.track, np.random.RandomState(seed)
    true = recording.times
    told = np.sort(np.clip(true + seconds * rng.normal(size=len(true)), track.times[0], track.times[-1]))
    return stamped(recording, told - true)


def sound_faster(recording: Recording, factor: float) -> Recording:
    """Let reported ranges be `factor` times the true ones: another speed of sound."""
    return changed(recording, lambda beam, _: replace(beam, range_resolution=factor * beam.range_resolution))


def ranges_offset(recording: Recording, metres: float) -> Recording:
    """Let all echoes come from farther: a delay between ping and recording."""

    def shifted(beam: Beam, _: int) -> Beam:
        bins = round(metres / beam.range_resolution)
        return replace(beam, intensities=np.append(np.zeros(bins, np.uint8), beam.intensities)[: len(beam.intensities)])

    return changed(recording, shifted)


def echoes_double(recording: Recording, share: float) -> Recording:
    """Let each echo come again from twice as far, `share` as strong: by the surface, or by the hull."""

    def doubled(beam: Beam, _: int) -> Beam:
        again = beam.intensities[np.arange(len(beam.intensities)) // 2] * share
        return replace(beam, intensities=np.maximum(beam.intensities, again).astype(np.uint8))

    return changed(recording, doubled)


def hull_heard(recording: Recording, metres: float) -> Recording:
    """Let a third of the circle hear a part of the vehicle, or a boat that follows it, at one distance."""

    def heard(beam: Beam, _: int) -> Beam:
        if np.cos(beam.angle) < 0.5:
            return beam
        first, strengths = int(metres / beam.range_resolution), beam.intensities.copy()
        strengths[first : first + 4] = max(int(strengths.max()), 100)
        return replace(beam, intensities=strengths)

    return changed(recording, heard)


def noise_rises(recording: Recording, at: float, level: float, seed: int = 1) -> Recording:
    """Let each bin tremble by `level`: the thrusters are heard."""
    rng = np.random.RandomState(seed)

    def noisy(beam: Beam, _: int) -> Beam:
        noise = np.abs(level * rng.normal(size=len(beam.intensities)))
        return replace(beam, intensities=np.minimum(beam.intensities + noise, _FULL).astype(np.uint8))

    return changed(recording, noisy, at)


def gain_fades(recording: Recording, factor: float) -> Recording:
    """Let echoes grow weaker all along, to `factor` of their strength at the end."""
    start, seconds = recording.track.times[0], recording.seconds

    def faded(beam: Beam, _: int) -> Beam:
        share = factor ** ((beam.stamp_ns * 1e-9 - start) / seconds)
        return replace(beam, intensities=(beam.intensities * share).astype(np.uint8))

    return changed(recording, faded)


def bottom_lost(recording: Recording, at: float, seconds: float, speed: float = 0.3) -> Recording:
    """Let the DVL lose the bottom for some seconds, in which a current carries the vehicle unfelt."""
    return odometry_drifts(recording, at, speed, seconds)


def axes_swapped(recording: Recording) -> Recording:
    """Let x and y of odom be swapped, as between east north up and north east down, and headings be right."""
    return with_odometry(recording, recording.track.poses[:, [1, 0, 2]])


def positions_swapped(recording: Recording) -> Recording:
    """Let x and y of the DVL be swapped, and headings be right."""
    steps = steps_of(recording.track.poses)
    steps[:, :2] = steps[:, 1::-1]
    return with_odometry(recording, integrated(recording.track.poses[0], steps))


def bins_longer(recording: Recording, at: float) -> Recording:
    """Let bins become twice as long, which the messages tell."""

    def longer(beam: Beam, _: int) -> Beam:
        pairs = beam.intensities[: len(beam.intensities) // 2 * 2].reshape(-1, 2)
        return replace(beam, intensities=pairs.max(axis=1), range_resolution=2.0 * beam.range_resolution)

    return changed(recording, longer, at)


def front_alone(recording: Recording, at: float) -> Recording:
    """Let the head look at a sector of 200 degrees ahead from a moment on."""
    return changed(recording, lambda beam, _: beam if np.cos(beam.angle) > np.cos(np.radians(100.0)) else None, at)
