import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sonar_simulator.echoes.beam_tracer import Contacts
from sonar_simulator.echoes.echo_model import make_echo_model
from sonar_simulator.echoes.physical import Physical, PhysicalParameters, absorption, scattered
from sonar_simulator.world.world import MATERIALS

STILL = {"speckle": 0.0, "noise_level_db": -300.0, "volume_scattering_db": -300.0, "ringing": 0.0}
AMPLITUDE = {"detector": "amplitude", "source_level_db": 100.0}


def _model(**values):
    return Physical(PhysicalParameters(**values))


def _wall(distance, rays=200, material="concrete", cosine=1.0, offset=(0.0, 0.0)):
    direction = np.array([1.0, *offset]) / np.linalg.norm([1.0, *offset])
    ranges = np.full((1, rays), float(distance))
    return Contacts.of_ranges(
        ranges, np.tile(direction, (1, rays, 1)), np.full((1, rays), cosine), materials=(MATERIALS[material],)
    )


def _level(contacts, **values):
    return 10.0 * np.log10(_model(**{**STILL, **values}).intensities(contacts).sum())


def _strengths(contacts, **values):
    return make_echo_model("physical", values).echoes(contacts, np.random.default_rng(0))


def _silence(beams):
    return Contacts.of_ranges(np.full((beams, 10), np.inf))


@pytest.mark.parametrize(
    ("frequency", "temperature", "salinity", "decibels_per_metre"),
    # Ainslie and McColm's figure 1 at 100 kHz; a head's own setting for 675 kHz in the sea; in fresh water friction.
    [(100.0, 10.0, 35.0, 0.034), (675.0, 15.0, 35.0, 0.2), (675.0, 15.0, 0.0, 0.128)],
)
def test_absorption_is_that_of_the_literature(frequency, temperature, salinity, decibels_per_metre):
    assert absorption(frequency, temperature, salinity) == pytest.approx(decibels_per_metre, rel=0.08)


def test_a_surface_that_fills_the_beam_loses_20_db_per_decade_and_the_absorption_both_ways():
    loss = _level(_wall(3.0)) - _level(_wall(30.0))
    assert loss == pytest.approx(20.0 + 2.0 * 27.0 * absorption(675.0, 15.0, 35.0), abs=1e-6)


def test_a_target_smaller_than_the_beam_loses_40_db_per_decade():
    far = _wall(30.0, rays=1000)
    hit = np.arange(1000) < 10
    far = Contacts.of_ranges(np.where(hit, far.ranges, np.inf), far.directions)
    near = Contacts.of_ranges(np.where(np.arange(1000) < 1000, 3.0, np.inf)[np.newaxis])
    loss = _level(near) - _level(far)
    assert loss == pytest.approx(40.0 + 2.0 * 27.0 * absorption(675.0, 15.0, 35.0), abs=1e-6)


def test_the_beam_is_3_db_down_each_way_at_its_openings():
    axis = _level(_wall(10.0))
    assert axis - _level(_wall(10.0, offset=(np.tan(np.radians(1.25)), 0.0))) == pytest.approx(6.0, abs=0.01)
    assert axis - _level(_wall(10.0, offset=(0.0, np.tan(np.radians(11.0))))) == pytest.approx(6.0, abs=0.01)


@given(st.sampled_from(sorted(MATERIALS)), st.floats(0.06, 1.0), st.floats(0.06, 1.0))
def test_no_material_sends_back_more_at_grazing_than_at_right_angles(name, one, other):
    low, high = sorted((one, other))
    weak, strong = scattered([MATERIALS[name]], np.zeros(2, dtype=int), np.array([low, high]))
    assert 0.0 < weak <= strong * (1.0 + 1e-9) or high < 0.5


def test_steel_is_louder_than_mud():
    assert _level(_wall(10.0, material="steel")) > _level(_wall(10.0, material="mud")) + 20.0


def test_an_echo_begins_in_its_bin_and_is_as_long_as_the_pulse():
    (bins,) = np.nonzero(_model(**STILL, pulse_length_us=400.0).intensities(_wall(10.05))[0])
    assert bins.tolist() == [100, 101, 102, 103]


def test_the_pulse_keeps_the_energy_of_an_echo():
    assert _level(_wall(10.05), pulse_length_us=10.0) == pytest.approx(_level(_wall(10.05), pulse_length_us=900.0))


def test_strengths_of_an_amplitude_detector_double_with_6_db():
    values = {**STILL, **AMPLITUDE, "full_level_db": 104.0}
    weak, strong = (_strengths(_wall(20.0), **values, gain_db=gain).max() for gain in (2.0, 8.02))
    assert 20 < weak < 63
    assert strong == pytest.approx(2 * int(weak), abs=1)


def test_strengths_of_a_decibel_detector_grow_by_the_gain():
    values = {**STILL, "detector": "decibels", "full_level_db": 125.0, "dynamic_range_db": 63.5}
    weak, strong = (int(_strengths(_wall(20.0), **values, gain_db=gain).max()) for gain in (5.0, 10.0))
    assert strong - weak == pytest.approx(10, abs=1)


@given(st.floats(0.0, 40.0), st.floats(0.0, 60.0), st.integers(0, 2**31))
def test_strengths_never_leave_0_to_127(gain, noise, seed):
    model = make_echo_model("physical", {"gain_db": gain, "noise_level_db": noise})
    assert model.echoes(_wall(5.0), np.random.default_rng(seed)).max() <= 127


def test_speckle_is_a_rayleigh_amplitude():
    values = {**STILL, **AMPLITUDE, "speckle": 1.0, "saturation": 255, "full_level_db": 96.0, "tvg_spreading": 0.0}
    strengths = _strengths(Contacts.of_ranges(np.full((4000, 1), 20.05)), **values)[:, 200].astype(float)
    assert strengths.mean() > 10.0
    assert strengths.std() / strengths.mean() == pytest.approx(np.sqrt(4.0 / np.pi - 1.0), abs=0.03)


def test_noise_is_there_without_any_surface_and_grows_with_the_heads_gain_over_range():
    strengths = _strengths(_silence(50), **AMPLITUDE, full_level_db=90.0)
    assert strengths[:, 450:].mean() > 2.0 * strengths[:, 200:250].mean() > 0.0


def test_the_transducer_rings_up_to_the_range_asked_for():
    ringing = {"ringing": 0.5, "ringing_level_db": 120.0, "noise_level_db": 0.0}
    (strengths,) = _strengths(_silence(1), **{**STILL, **AMPLITUDE, **ringing}, full_level_db=90.0, max_range=10.0)
    assert strengths[2] > 50
    assert strengths[26:].max() < 20


def test_the_vehicle_sends_a_strong_echo_out_once_more():
    first = _model(**STILL).intensities(_wall(10.05))[0]
    both = _model(**STILL, vehicle_target_db=-10.0).intensities(_wall(10.05))[0]
    assert np.flatnonzero(first > first.max() * 1e-9).tolist() == [100, 101]
    second = both.copy()
    second[:150] = 0.0
    assert 200 <= second.argmax() <= 202
    assert 0.0 < second.max() < 0.01 * first.max()
