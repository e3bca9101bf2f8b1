"""What goes along with the vehicle is found by its beams, told from walls that it follows, and left out."""

import numpy as np
import pytest
from benchmarks import fault_makers as broken
from benchmarks import rare_faults as rare
from made_recordings import touring

from mlsm_manager.scan_matching.scan import Track
from mlsm_manager.self_check.companions import without_companions
from sonar_processing.beams.beam import Beam, PlacedBeam

pytestmark = pytest.mark.long

WHOLE = touring()


def test_what_goes_along_with_the_vehicle_is_left_out():
    heard = rare.hull_heard(WHOLE, 5.0)
    beams, causes = without_companions(heard.beams, WHOLE.track)
    assert [cause.text for cause in causes] == [
        "something 4.9 m away goes along with the vehicle, in 120 deg of the circle"
    ]
    assert not any(one.beam.intensities[round(5.0 / one.beam.range_resolution) + 1] for one in beams[:3])
    assert without_companions(WHOLE.beams, WHOLE.track) == (WHOLE.beams, [])


def test_it_is_left_out_also_where_its_echoes_become_longer():
    heard = broken.echoes_longer(rare.hull_heard(WHOLE, 5.0), 0.6 * WHOLE.seconds, 10)
    beams, _ = without_companions(heard.beams, WHOLE.track)
    towards = [one.beam for one in beams[-400:] if np.cos(one.beam.angle) > 0.5]
    near = slice(*np.round(np.array([5.0, 7.5]) / towards[0].range_resolution).astype(int))
    assert not np.concatenate([beam.intensities[near] for beam in towards]).any()


def _beams(angles, ranges):
    """Return a beam per second, with one echo each."""
    strengths = 100 * (np.abs(0.1 * np.arange(300) - ranges[:, np.newaxis]) < 0.3).astype(np.uint8)
    return [
        PlacedBeam(Beam(round(1e9 * number), "sonar", angle, heard, 0.1), np.eye(4), True)
        for number, (angle, heard) in enumerate(zip(angles, strengths))
    ]


def _goes_along(angles, ranges):
    """Return whether something goes along with a vehicle that turns on the spot, once in all."""
    times = np.arange(float(len(angles)))
    turning = Track(times, np.column_stack([0.0 * times, 0.0 * times, 2.0 * np.pi * times / len(times)]))
    return bool(without_companions(_beams(angles, ranges), turning)[1])


@pytest.mark.parametrize("leaves", [0.0, 20.0])
def test_a_wall_that_the_vehicle_follows_does_not_go_along(leaves):
    """In the last 18 % of the time it goes `leaves` m away, and hears anything."""
    angles = np.radians(np.arange(0.0, 3600.0, 3.0))
    times = np.arange(float(len(angles)))
    aside = leaves * np.maximum(times / times[-1] - 0.82, 0.0) / 0.18
    anything = np.random.RandomState(1).uniform(2.0, 25.0, len(angles))
    beams = _beams(angles, np.where(aside > 0.0, anything, 4.0 / np.maximum(np.sin(angles), 0.01)))
    straight = Track(times, np.column_stack([0.1 * times, aside, 0.0 * times]))
    assert without_companions(beams, straight) == (beams, [])


@pytest.mark.parametrize(
    ("other_sector", "other_range", "goes_along"), [(6, 5.2, True), (6, 9.0, False), (20, 5.2, False)]
)
def test_what_goes_along_is_heard_in_sectors_beside_each_other(other_sector, other_range, goes_along):
    """A vehicle that turns hears an echo at 5 m in the sixth of 36 sectors, one in another, elsewhere any range."""
    angles, random = np.radians(np.arange(0.5, 3600.0, 3.0)), np.random.RandomState(1)
    sectors = (np.degrees(angles) // 10 % 36).astype(int)
    ranges = np.select(
        [sectors == 5, sectors == other_sector], [5.0, other_range], random.uniform(2.0, 25.0, len(angles))
    )
    assert _goes_along(angles, ranges) == goes_along


@pytest.mark.parametrize(("turns", "named"), [(4.0, False), (7.0, True)])
def test_what_the_head_heard_in_few_turns_may_not_go_along(turns, named):
    angles = np.radians(np.arange(0.5, 360.0 * turns, 3.0))
    ahead = np.abs(np.sin(angles / 2.0)) < 0.3
    ranges = np.where(ahead, 5.0, np.random.RandomState(1).uniform(2.0, 25.0, len(angles)))
    assert _goes_along(angles, ranges) == named


@pytest.mark.parametrize(("elsewhere", "named"), [(0.1, True), (0.5, False)])
def test_what_is_heard_as_far_away_in_other_directions_does_not_go_along(elsewhere, named):
    """In a small tank walls are as far away wherever the vehicle turns, in some directions by chance mostly."""
    angles, random = np.radians(np.arange(0.5, 3600.0, 3.0)), np.random.RandomState(1)
    is_near = (np.abs(np.sin(angles / 2.0)) < 0.3) | (random.uniform(size=len(angles)) < elsewhere)
    assert _goes_along(angles, np.where(is_near, 5.0, random.uniform(8.0, 25.0, len(angles)))) == named
