"""A Micron of another team, in its own message type: nothing but beams, and a bank on one side."""

import numpy as np
import pytest

from mlsm_manager.offline.recording import read_recording, scans_of
from recordings.motion.vehicle_motion import MotionNames, MotionSource
from recordings.reader import Request
from sonar_processing.filters.echo_extractor import EchoExtractor, EchoExtractorParameters

BEAMS, TURNS = 2028, 10


@pytest.fixture(scope="module")
def micron(recording):
    bag = recording("micron_scanline.bag")
    return read_recording(bag, Request(motion=MotionNames(declared=MotionSource.STANDING)))


def test_no_beam_is_lost(micron):
    assert (len(micron.beams), micron.unplaced) == (BEAMS, 0)


def test_beams_are_as_the_driver_says(micron):
    beams = [placed.beam for placed in micron.beams]
    assert {beam.intensities.size for beam in beams} == {200}
    np.testing.assert_allclose([beam.range_resolution for beam in beams], 0.05)
    steps = np.diff(np.unwrap([beam.angle for beam in beams]))
    np.testing.assert_allclose(np.degrees(steps), 1.8, atol=1e-3)
    assert {beam.frame_id for beam in beams} == {"Micron"}


def test_what_was_assumed_is_said(micron):
    notes = " ".join(micron.notes)
    assert "angles in degrees" in notes
    assert "mounted in base_link" in notes


def test_every_turn_hears_the_bank_as_one_line(micron):
    """The vehicle swings, so that the bank is elsewhere in each turn; within one turn it is a line."""
    scans = [scan for scan, _ in scans_of(micron, EchoExtractor(EchoExtractorParameters()))]
    assert len(scans) == TURNS
    for scan in scans[1:]:
        bank = scan.points[(scan.points[:, 0] > 2.0) & (np.abs(scan.points[:, 1]) < 6.0)]
        assert len(bank) > 20
        line = np.polyfit(bank[:, 1], bank[:, 0], 2)
        assert np.median(np.abs(np.polyval(line, bank[:, 1]) - bank[:, 0])) < 0.5
