"""A head whose angles tremble is told from one that sweeps sectors or loses beams, and is made to turn steadily."""

from dataclasses import replace

import numpy as np
import pytest
from clouds import beam_of
from hypothesis import given
from hypothesis import strategies as st

from sonar_processing.beams.beam import PlacedBeam
from sonar_processing.beams.steady_head import SteadyHead, steadied
from sonar_processing.scans.assembler import RevolutionCollector

STEP = np.radians(3.0)
TURNS = STEP * np.arange(600)


def _beams(angles):
    """Return beams at `angles` (n,) [rad], ten in a second."""
    return [beam_of(angle=float(angle), seconds=number / 10) for number, angle in enumerate(angles)]


def _trembling(degrees, angles=TURNS):
    noise = np.radians(degrees) * np.random.RandomState(1).normal(size=len(angles))
    return _beams((angles + noise + np.pi) % (2.0 * np.pi) - np.pi)


def _live(beams, head=None):
    head = head or SteadyHead()
    return [steady for beam in beams for steady in head.add(beam)]


def _errors(beams, true):
    """Return by how much (n,) [deg] the angles of beams differ from `true` (n,) [rad]."""
    return np.degrees(np.angle(np.exp(1j * (np.array([beam.angle for beam in beams]) - true))))


def _turn_lengths(beams):
    collector = RevolutionCollector()
    turns = [collector.add(PlacedBeam(beam, np.eye(4), is_moving=False)) for beam in beams]
    return [len(turn) for turn in turns if turn is not None]


@pytest.mark.parametrize("degrees", [2.0, 3.0, 6.0, 10.0])
@pytest.mark.parametrize("direction", [1, -1])
def test_angles_that_tremble_become_those_of_the_turn(degrees, direction):
    true = direction * TURNS
    found = steadied(_trembling(degrees, true))
    assert np.degrees(found.deviation) == pytest.approx(degrees, rel=0.2)
    assert found.share == 1.0
    assert np.std(_errors(found.beams, true)) < 0.2 * degrees


def test_a_turn_of_angles_that_tremble_holds_every_direction_once():
    assert len(_turn_lengths(_trembling(6.0))) > 20
    assert _turn_lengths(steadied(_trembling(6.0)).beams) == pytest.approx([120] * 5, abs=2)


def test_a_run_that_goes_on_gets_the_angles_of_the_turn_a_little_later():
    head = SteadyHead()
    passed = _live(_trembling(6.0), head)
    assert head.trembles
    assert np.degrees(head.deviation) == pytest.approx(6.0, rel=0.3)
    assert [beam.stamp_ns for beam in passed] == [beam.stamp_ns for beam in _beams(TURNS)][:-30]
    assert np.std(_errors(passed[100:], TURNS[100:-30])) < 1.2


def test_a_head_that_trembles_no_more_is_passed_on_at_once_again():
    head = SteadyHead()
    _live(_trembling(6.0), head)
    later = _beams(STEP * np.arange(600, 1200))
    passed = _live([replace(beam, stamp_ns=beam.stamp_ns + 60 * 10**9) for beam in later], head)
    assert not head.trembles
    assert len(passed) == 630
    assert np.abs(_errors(passed[-200:], STEP * np.arange(1000, 1200))).max() < 1e-4


def test_beams_before_a_silence_of_the_head_are_passed_on_before_those_after_it():
    head = SteadyHead()
    beams = _trembling(6.0)
    passed = _live(beams, head)
    passed += head.add(replace(beams[-1], stamp_ns=beams[-1].stamp_ns + 60 * 10**9))
    assert [beam.stamp_ns for beam in passed] == [beam.stamp_ns for beam in beams]


def _swing(count):
    """Return the numbers of steps of a head that sweeps a sector of `count` beams to and fro, 600 beams."""
    one = np.concatenate([np.arange(count - 1), np.arange(count - 1, 0, -1)])
    return np.tile(one, 600 // len(one) + 1)[:600]


@pytest.mark.long
@given(st.integers(2, 150), st.sampled_from([1, -1]), st.floats(0.0, 0.5), st.integers(0, 99))
def test_a_head_that_sweeps_a_sector_and_loses_beams_is_left_as_it_is(count, direction, lost, seed):
    kept = np.random.RandomState(1).uniform(size=600) >= lost
    beams = _beams(direction * STEP * _swing(count)[kept])
    assert steadied(beams) is None
    assert all(one is other for one, other in zip(_live(beams), beams))


@given(st.integers(0, 99), st.floats(0.0, 0.5))
def test_a_head_that_turns_round_and_loses_beams_is_left_as_it_is(seed, lost):
    beams = [beam for beam, one in zip(_beams(TURNS), np.random.RandomState(1).uniform(size=600)) if one >= lost]
    assert steadied(beams) is None
    assert _live(beams) == beams
