"""What strengths tell of echoes: peaks or plateaus, and their length along range."""

import numpy as np
import pytest

from sonar_processing.filters.echo_peaks import EchoStatistics


def heard(*turns, resolution=0.1):
    """Return what is known after turns of (beams, bins) strengths."""
    statistics = EchoStatistics(np.shape(turns[0])[1], resolution)
    for turn in turns:
        statistics.add(np.asarray(turn, dtype=np.uint8))
    return statistics


def echoing(sigma, noise=0.0, seed=0, beams=120):
    """Return (beams, bins) with one echo per beam, of `sigma` [m] along range, anywhere."""
    rng, bins = np.random.RandomState(seed), np.arange(400)
    places = rng.uniform(60.0, 340.0, beams)[:, np.newaxis]
    echoes = 90.0 * np.exp(-0.5 * ((bins - places) * 0.1 / sigma) ** 2)
    return echoes + np.abs(rng.normal(0.0, noise, (beams, 400)))


@pytest.mark.parametrize(
    ("strengths", "are_plateaus"),
    [
        *(([0, 0, strongest, strongest, strongest, 0], True) for strongest in (1, 127, 255)),
        ([0, 3, 60, 127, 127, 80, 5, 0], False),
        ([0, 0, 0], False),
    ],
)
def test_strengths_that_say_something_or_nothing_are_plateaus_and_those_that_differ_are_peaks(strengths, are_plateaus):
    assert heard([strengths]).are_plateaus is are_plateaus


@pytest.mark.parametrize("gains", [np.repeat([1.0, 0.3, 2.0], 120), 0.3 ** np.linspace(0.0, 1.0, 3600)])
def test_plateaus_are_known_as_such_while_the_gain_changes(gains):
    strengths = (127.0 * gains[:, np.newaxis] * (echoing(0.5, beams=len(gains)) > 20.0)).astype(np.uint8)
    assert heard(*np.split(strengths, len(gains) // 120)).are_plateaus


def test_a_turn_of_few_equal_strengths_is_outvoted_by_later_ones():
    one_echo = np.zeros((120, 400))
    one_echo[0, 100] = 30.0
    assert heard(one_echo).are_plateaus
    assert not heard(one_echo, echoing(0.5)).are_plateaus


@pytest.mark.parametrize("sigma", [0.2, 0.5, 1.0])
@pytest.mark.parametrize("noise", [0.0, 6.0])
def test_one_turn_tells_the_length_of_echoes(sigma, noise):
    assert heard(echoing(sigma, noise)).sigma == pytest.approx(sigma, rel=0.15)


def test_further_turns_tell_the_length_of_echoes_better():
    turns = [echoing(0.5, noise=6.0, seed=seed, beams=12) for seed in range(30)]
    alone = np.array([heard(turn).sigma for turn in turns])
    assert np.ptp([heard(*turns[part::3]).sigma for part in range(3)]) < np.ptp(alone) / 2.0


@pytest.mark.parametrize("strengths", [[0, 0, 0, 0, 0], [7], [9, 9, 9, 9, 9, 9]])
def test_without_echoes_the_shortest_pulse_is_taken(strengths):
    assert heard([strengths]).sigma == 0.15


@pytest.mark.parametrize(
    ("bins", "resolution", "same"), [(400, 0.1, True), (400, 0.10001, True), (399, 0.1, False), (400, 0.12, False)]
)
def test_beams_of_another_range_do_not_belong_to_the_others(bins, resolution, same):
    assert EchoStatistics(400, 0.1).has_bins(bins, resolution) is same
