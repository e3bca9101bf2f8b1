"""Which echoes come out of a polar scan, and where they lie."""

from dataclasses import replace

import numpy as np
import pytest
from clouds import SECOND, cloud_of, placed
from hypothesis import given
from hypothesis import strategies as st

from node_support.errors import RefusedInput
from sonar_processing.filters.echo_extractor import (
    EchoExtractor,
    EchoExtractorParameters,
    ExtractionMode,
    extract_echoes,
)
from sonar_processing.filters.threshold import height_threshold
from sonar_processing.scans.parameters import SonarToCloudParameters
from sonar_processing.scans.polar_scan import PolarScan

BEAMS, RESOLUTION = 60, 0.1
# A wall that is nearest in the middle of the scan.
WALL = 150.0 + 0.05 * (np.arange(BEAMS) - 30.0) ** 2


def wall_image(ranges, bins=400, sigma=2.0, height=100.0):
    """Return (beams, bins) float32 with one Gaussian echo per beam, centred on the fractional bins `ranges`."""
    bin_numbers = np.arange(bins)
    return (height * np.exp(-0.5 * ((bin_numbers - np.asarray(ranges)[:, np.newaxis]) / sigma) ** 2)).astype(np.float32)


def with_ring(image, at, width=30, strength=60.0):
    """Return the image with a ring of the same strength in every direction."""
    ringed = image.copy()
    ringed[:, at : at + width] += strength
    return ringed


def with_speckle(image, seed, strength=30.0):
    """Return the image with Rayleigh noise."""
    return image + np.random.default_rng(seed).rayleigh(strength / 3.0, image.shape).astype(np.float32)


def binary_image(starts, lengths):
    """Return (beams, bins) uint8 of strengths 0 and 127: one run per beam."""
    after = np.arange(400) - np.asarray(starts)[:, np.newaxis]
    return np.where((after >= 0) & (after < np.asarray(lengths)[:, np.newaxis]), 127, 0).astype(np.uint8)


def twenty_runs(length):
    """Return (beams, bins) uint8: strengths of 127 from bin 150 on in the first 20 beams."""
    return binary_image([150] * BEAMS, np.where(np.arange(BEAMS) < 20, length, 0))


PEAKS = {"mode": "MATCHED_FILTER", "pulse_sigma": 0.15}
MEASURED = EchoExtractorParameters(pulse_sigma=0.0)
SETTLED_MODES = [mode for mode in ExtractionMode if mode is not ExtractionMode.AUTO]
STRONG_ONLY = {"threshold_share": 1.0, "min_height": 10.0}


def test_a_wall_ahead_in_a_narrow_sector_is_no_ring():
    """It is heard at about one range in all directions, which in a whole turn is an echo of the floor."""
    ahead = wall_image(np.full(20, 150.0))
    for is_narrow, echoes in ((True, 20), (False, 0)):
        assert len(extract_echoes(ahead, RESOLUTION, EchoExtractorParameters(**PEAKS), is_narrow)[0]) == echoes


def _echoes(image, **values):
    return extract_echoes(image, RESOLUTION, EchoExtractorParameters(**{**PEAKS, **values}))[0]


def test_an_echo_is_found_between_the_bins():
    echoes = _echoes(wall_image(WALL))
    assert echoes.beams.tolist() == list(range(BEAMS))
    np.testing.assert_allclose(echoes.bins, WALL, atol=0.03)


@pytest.mark.parametrize(
    ("image", "share_behind_the_hull"),
    [(wall_image(WALL), None), *((with_ring(wall_image(WALL), at=80), share) for share in (None, 0.0, 0.05))],
)
def test_speckle_and_the_ring_of_the_floor_leave_the_wall_also_where_the_hull_hides_half(image, share_behind_the_hull):
    image, heard = with_speckle(image, seed=2), BEAMS
    if share_behind_the_hull is not None:
        heard = BEAMS // 2
        image[heard:] *= share_behind_the_hull
    echoes = _echoes(image, **STRONG_ONLY)
    assert set(echoes.beams) == set(range(heard))
    assert np.abs(echoes.bins - WALL[echoes.beams]).max() < 2.0


def test_without_taking_the_ring_off_it_is_found_in_every_direction():
    echoes = _echoes(with_ring(wall_image(WALL), at=80), ring_quantile=0.0)
    assert set(echoes.beams[np.abs(echoes.bins - 95.0) < 15.0]) == set(range(BEAMS))


def test_a_wall_inside_the_ring_is_still_found():
    echoes = _echoes(with_ring(wall_image(WALL), at=140, width=60))
    assert set(echoes.beams) == set(range(BEAMS))
    assert np.median(np.abs(echoes.bins - WALL[echoes.beams])) < 0.5


def test_heights_are_what_stands_out_of_the_ring():
    image = with_ring(twenty_runs(40).astype(np.float32), at=100, width=200, strength=50.0)
    np.testing.assert_allclose(_echoes(image).heights, 127.0, atol=0.1)


def test_nothing_nearer_than_min_range_is_an_echo():
    image = wall_image(WALL) + wall_image(np.where(np.arange(BEAMS) % 2, 20.0, -100.0))
    assert _echoes(image, min_range=1.0).bins.min() < 25
    assert _echoes(image, min_range=3.0).bins.min() > 100


def test_contrast_keeps_echoes_out_of_a_scan_of_speckle_alone():
    """Limits of the counts hold for the median of nine scans: single ones scatter around them, and releases of numpy
    draw different speckle from the same seeds."""
    speckle = [with_speckle(np.zeros((120, 500), np.float32), seed=seed, strength=90.0) for seed in range(9)]
    without, usual, high = (
        np.array([len(_echoes(image, **STRONG_ONLY, **values)) for image in speckle])
        for values in ({"min_contrast": 0.0}, {}, {"min_contrast": 15.0})
    )
    assert (without > 500).all()
    assert (usual < without).all()
    assert (high < usual).all()
    assert np.median(usual) < 500
    assert np.median(high) < 60


def test_a_scan_of_nothing_and_echoes_lower_than_min_height_give_none():
    parameters = EchoExtractorParameters(**PEAKS, min_height=30.0)
    for image in (np.zeros((BEAMS, 400), np.uint8), wall_image(WALL, height=20.0)):
        echoes, threshold = extract_echoes(image, RESOLUTION, parameters)
        assert (len(echoes), threshold) == (0, 30.0)


def test_a_smaller_share_of_the_threshold_keeps_a_weak_wall_beside_a_strong_one():
    heights = np.where(np.arange(BEAMS) % 2, 200.0, 60.0)[:, np.newaxis]
    image = wall_image(WALL, height=1.0) * heights
    assert len(_echoes(image, threshold_share=1.0)) == BEAMS // 2
    assert len(_echoes(image, threshold_share=0.5)) == BEAMS


def test_binary_strengths_give_one_echo_per_run_in_its_middle():
    echoes = _echoes(binary_image([150] * 30 + [200] * 30, [28] * 30 + [9] * 30))
    assert echoes.bins.tolist() == [163.5] * 30 + [204.0] * 30


def test_the_leading_edge_of_a_binary_run_is_where_it_begins():
    echoes = _echoes(binary_image(np.arange(150, 270, 2), [28] * 60), mode="LEADING_EDGE")
    np.testing.assert_allclose(echoes.bins, np.arange(149.5, 269.5, 2.0), atol=0.01)


def test_the_leading_edge_lies_before_the_peak_by_as_much_whatever_the_strength():
    heights = np.linspace(110.0, 200.0, BEAMS)[:, np.newaxis]
    before = WALL - _echoes(wall_image(WALL, height=1.0) * heights, mode="LEADING_EDGE").bins
    assert before.min() > 1.0
    assert np.ptp(before) < 0.25


def test_peaks_of_one_echo_have_one_leading_edge():
    image = twenty_runs(60).astype(np.float32)
    image[:20, 180:184] -= 30.0
    assert len(_echoes(image)) == 40
    assert len(_echoes(image, mode="LEADING_EDGE")) == 20


@pytest.mark.parametrize(("spacing", "per_run"), [(0.1, 28), (0.5, 6), (2.8, 1), (50.0, 1)])
def test_dense_points_stand_all_along_a_run(spacing, per_run):
    echoes = _echoes(twenty_runs(28), mode="DENSE", spacing=spacing)
    assert np.bincount(echoes.beams).tolist() == [per_run] * 20
    assert (echoes.bins.min(), echoes.bins.max() <= 177) == (150, True)


@pytest.mark.parametrize("mode", ["MATCHED_FILTER", "LEADING_EDGE", "DENSE"])
@pytest.mark.parametrize("sigma", [0.1, 2.0])
@pytest.mark.parametrize("at", [0, 1, 398, 399])
def test_an_echo_at_either_end_of_the_range_lies_there(mode, at, sigma):
    echoes = _echoes(wall_image([at] * 20 + [-100.0] * 40, sigma=sigma), mode=mode, min_range=0.0, spacing=9.0)
    assert echoes.beams.tolist() == list(range(20))
    assert np.abs(echoes.bins - at).max() < 3.5


@given(st.integers(0, 2**32 - 1), st.sampled_from(SETTLED_MODES), st.sampled_from([0.0, 0.3, 0.9]))
def test_no_scan_breaks_it_and_every_echo_lies_in_the_scan(seed, mode, quantile):
    rng = np.random.default_rng(seed)
    image = rng.integers(0, rng.integers(1, 257), (rng.integers(10, 30), rng.integers(1, 40)), dtype=np.uint8)
    echoes = _echoes(image, mode=mode, ring_quantile=quantile, min_range=0.0, min_height=0.0)
    assert len(echoes.beams) == len(echoes.bins) == len(echoes.heights)
    assert np.isfinite(echoes.bins).all()
    assert ((echoes.bins >= -0.5) & (echoes.bins <= image.shape[1] - 0.5)).all()
    assert ((echoes.beams >= 0) & (echoes.beams < len(image))).all()
    assert (echoes.heights > 0).all()


def test_the_order_of_the_beams_makes_no_difference():
    image = with_speckle(wall_image(WALL), seed=3)
    there, back = _echoes(image), _echoes(image[::-1])
    np.testing.assert_array_equal(np.sort(there.bins), np.sort(back.bins))


def test_too_few_beams_show_no_ring_and_are_enough_where_none_is_taken_off():
    with pytest.raises(RefusedInput, match=r"^5, must be at least 6") as refused:
        _echoes(wall_image(WALL[:5]))
    assert refused.value.kind == "scans of too few beams"
    assert len(_echoes(wall_image(WALL[:2]), ring_quantile=0.0)) == 2


def test_the_threshold_is_never_above_half_of_the_highest():
    assert height_threshold(np.array([100.0, 120.0, 127.0])) == 63.5
    assert height_threshold(np.zeros(0)) == 0.0


def _polar_cloud(image, *, moving_by=0.0, **values):
    """Return the organised cloud of a turn of a vehicle that moves along +x by `moving_by` m per beam."""
    beams = [
        placed(
            strengths=strengths, angle=2 * np.pi * number / len(image), resolution=RESOLUTION, seconds=number + 1,
            shift=(moving_by * number, 0.0, 0.0), moving=moving_by > 0,
        )
        for number, strengths in enumerate(np.clip(image, 0, 255).astype(np.uint8))
    ]  # fmt: skip
    return PolarScan.of(beams).cloud(SonarToCloudParameters(**{"min_range": 0.0, **values}))


@pytest.fixture
def extractor():
    return EchoExtractor(EchoExtractorParameters())


@pytest.mark.parametrize("moving_by", [0.0, 0.03])
def test_the_stage_places_every_echo_by_the_pose_of_its_beam(extractor, moving_by):
    cloud = extractor(_polar_cloud(wall_image(WALL), moving_by=moving_by))
    angles, ranges = 2 * np.pi * np.arange(BEAMS) / BEAMS, (WALL + 0.5) * RESOLUTION
    expected = np.column_stack([ranges * np.cos(angles) + moving_by * np.arange(BEAMS), ranges * np.sin(angles)])
    np.testing.assert_allclose(cloud.points[:, :2], expected, atol=0.01)
    assert cloud.points.dtype == np.float32


@pytest.mark.parametrize("shift", [1e-6, 1e-5, 1e-4, 3.3, 30.1])
def test_the_stage_finds_the_same_echoes_wherever_the_sonar_is(shift):
    """Widths of 3 and 12 bins are whole numbers but for the rounding of float32 points."""
    polar = _polar_cloud(with_speckle(wall_image(WALL), seed=3))
    moved = replace(polar, points=polar.points + np.float32([shift, 0.0, 0.0, 0.0]))
    parameters = EchoExtractorParameters(**PEAKS, min_height=1.0, threshold_share=0.1)
    echoes, of_moved = (EchoExtractor(parameters)(cloud) for cloud in (polar, moved))
    np.testing.assert_allclose(of_moved.points[:, 3], echoes.points[:, 3], rtol=1e-3)


def test_the_stage_gives_every_echo_the_stamp_of_its_beam(extractor):
    cloud = extractor(_polar_cloud(wall_image(WALL), moving_by=0.01))
    np.testing.assert_allclose(cloud.time_stamps, np.arange(1, BEAMS + 1))
    assert (cloud.stamp_ns, cloud.frame_id, cloud.height) == (BEAMS * SECOND, "odom", 1)


def test_the_stage_hears_nothing_in_removed_bins(extractor):
    cloud = extractor(_polar_cloud(wall_image(WALL), min_range=17.0))
    assert 0 < len(cloud) < BEAMS
    assert np.isfinite(cloud.points).all()
    assert np.hypot(*cloud.points[:, :2].T).min() > 16.9


def test_the_stage_tells_its_threshold(extractor):
    assert extractor.newest_threshold is None
    extractor(_polar_cloud(wall_image(WALL)))
    assert 2.0 <= extractor.newest_threshold < 127.0


def test_a_cloud_without_rows_or_of_removed_points_only_is_refused(extractor):
    with pytest.raises(RefusedInput, match="not organised"):
        extractor(cloud_of([1, 2, 3]))
    with pytest.raises(RefusedInput, match="no two neighbouring bins"):
        extractor(_polar_cloud(wall_image(WALL), min_range=90.0))


def _stamped(image, seconds):
    """Return the cloud of a turn that ends `seconds` later than others."""
    cloud = _polar_cloud(image)
    return replace(cloud, stamp_ns=cloud.stamp_ns + seconds * SECOND)


def _settled(extractor, *clouds):
    """Return mode and width with which the newest of some clouds was extracted."""
    for cloud in clouds:
        extractor(cloud)
    return extractor.newest_parameters.mode, extractor.newest_parameters.pulse_sigma


PLATEAUS = binary_image([150] * 30 + [200] * 30, [28] * 30 + [9] * 30)


@pytest.mark.parametrize(
    ("image", "mode", "sigma"),
    [
        (wall_image(WALL, sigma=4.0), ExtractionMode.MATCHED_FILTER, pytest.approx(0.4, rel=0.05)),
        (PLATEAUS, ExtractionMode.DENSE, 0.15),
    ],
)
def test_the_first_scan_is_already_extracted_as_suits_its_echoes(image, mode, sigma):
    assert _settled(EchoExtractor(MEASURED), _polar_cloud(image)) == (mode, sigma)


def test_what_the_user_names_is_not_measured():
    named = EchoExtractorParameters(mode="LEADING_EDGE", pulse_sigma=0.3)
    assert _settled(EchoExtractor(named), _polar_cloud(PLATEAUS)) == (ExtractionMode.LEADING_EDGE, 0.3)
    assert _settled(EchoExtractor(EchoExtractorParameters(pulse_sigma=0.3)), _polar_cloud(PLATEAUS))[1] == 0.3


def test_all_scans_with_the_same_bins_tell_the_width_of_echoes():
    narrow, wide = _stamped(wall_image(WALL, sigma=2.0), 0), _stamped(wall_image(WALL, sigma=6.0), 60)
    _, sigma = _settled(EchoExtractor(MEASURED), narrow, wide)
    assert 0.25 < sigma < 0.6


@pytest.mark.parametrize("seconds", [-60, 60])
def test_other_bins_or_a_time_that_jumps_back_begin_anew(seconds):
    bins = 400 if seconds < 0 else 300
    alone = _stamped(wall_image(WALL, bins=bins, sigma=6.0), seconds)
    extractor = EchoExtractor(MEASURED)
    extractor(_stamped(wall_image(WALL, sigma=2.0), 0))
    assert _settled(extractor, alone) == _settled(EchoExtractor(MEASURED), alone)
