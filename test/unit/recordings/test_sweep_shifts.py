"""Sweeps in a room with a bay: of a head that stands, that swings and that travels."""

import numpy as np
import pytest
from made_recordings import ranges_along

from recordings.beams import RecordedBeams
from recordings.motion.sweep_shifts import SweepMotion, sweep_shifts
from recordings.survey import beam_lines
from sonar_processing.beams.beam import Beam

STEP, BINS, RESOLUTION = np.radians(1.8), 300, 0.05
TURN = 200
WALLS = np.array([[-5.0, -4.0], [6.0, -4.0], [6.0, 1.0], [9.0, 1.0], [9.0, 5.0], [-5.0, 5.0]])


def beams(place_at, steps=range(4 * TURN)):
    """Return beams, ten per second, of a head that is at `place_at(seconds)`, with speckle."""
    generator, angles = np.random.default_rng(1), STEP * np.array(steps)
    ranges = ranges_along(np.array([place_at(0.1 * index) for index in range(len(steps))]), angles, WALLS)
    made = []
    for index, (angle, distance) in enumerate(zip(angles, ranges)):
        strengths = generator.exponential(8.0, BINS)
        first = int(distance / RESOLUTION)
        strengths[first : first + 6] += 120.0
        echoes = np.minimum(strengths, 255.0).astype(np.uint8)
        made.append(Beam((index + 10) * 10**8, "sonar", angle, echoes, RESOLUTION))
    return made


@pytest.mark.parametrize(
    ("place_at", "motion"),
    [
        (lambda _: (0.0, 0.0), SweepMotion.STILL),
        (lambda time: (0.02 * time, 0.03 * time), SweepMotion.DRIFTING),
        (lambda time: (0.125 * time - 4.5, 0.06 * time - 3.0), SweepMotion.MOVING),
    ],
)
def test_sweeps_tell_whether_the_head_stood_still(place_at, motion):
    assert sweep_shifts(beams(place_at)).motion is motion


def test_one_turn_or_noise_tells_no_motion():
    assert sweep_shifts(beams(lambda _: (0.0, 0.0))[: TURN + 5]).motion is SweepMotion.UNTOLD
    noise = np.random.default_rng(2).integers(0, 60, (3 * TURN, BINS)).astype(np.uint8)
    heard = [Beam(index + 1, "sonar", index * STEP, one, RESOLUTION) for index, one in enumerate(noise)]
    assert sweep_shifts(heard).motion is SweepMotion.UNTOLD


def test_beams_shorter_than_the_head_rings_tell_no_motion():
    heard = [Beam(index + 1, "sonar", index * STEP, np.ones(10, np.uint8), RESOLUTION) for index in range(3 * TURN)]
    assert sweep_shifts(heard).motion is SweepMotion.UNTOLD


def test_few_sweeps_or_one_direction_are_not_called_still_or_moved():
    to_and_fro = [*range(-13, 14), *range(13, -14, -1)]
    assert sweep_shifts(beams(lambda _: (0.0, 0.0), 8 * to_and_fro)).motion is SweepMotion.UNTOLD
    assert sweep_shifts(beams(lambda time: (0.3 * (time > 1.5), 0.0), to_and_fro)).motion is SweepMotion.UNTOLD


def test_a_sector_that_crosses_angle_zero_tells_as_any_other():
    to_and_fro = [*range(-52, 53), *range(52, -53, -1)]
    assert sweep_shifts(beams(lambda _: (0.0, 0.0), 4 * to_and_fro)).motion is SweepMotion.STILL
    assert sweep_shifts(beams(lambda time: (0.03 * time, 0.03 * time), 4 * to_and_fro)).motion is SweepMotion.DRIFTING


def test_head_settings_gaps_and_motion_are_told():
    made = beams(lambda _: (0.0, 0.0), 4 * [*range(50), *range(49, -1, -1)])
    late = [Beam(one.stamp_ns + 10**11, "sonar", one.angle, one.intensities, 0.1) for one in made[:10]]
    gains = [0] * 200 + [2] * 210
    told = beam_lines(RecordedBeams(made + late, [], refused=3, gains=gains))
    assert told[:2] == [
        "410 beams in 100.9 s; 3 messages damaged or without a beam",
        "the head made 8 sweeps of 86 degrees",
    ]
    assert told[2] == "range: 15 m in 300 bins from 0.0 s, 30 m in 300 bins from 100.0 s"
    assert told[3:5] == ["step: 1.8 degrees from 0.0 s", "gain: 0 from 0.0 s, 2 from 20.0 s"]
    assert told[5] == "1 gap longer than 1 s, the longest 60.1 s after 39.9 s"
    assert told[6].startswith("motion as sweeps show it: still; ")
