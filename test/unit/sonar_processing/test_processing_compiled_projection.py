"""Compiled loops place the bins of a scan where numpy places them, and leave the same ones out."""

import numpy as np
import pytest
from clouds import beam_of
from hypothesis import given
from hypothesis import strategies as st

from node_support.kernels import Kernel
from node_support.parameters import ParameterError
from sonar_processing.beams.placed_beam import PlacedBeam
from sonar_processing.scans.assembler import ScanAssembler
from sonar_processing.scans.parameters import SonarToCloudParameters

pytest.importorskip("numba")


def _pose(rng):
    """Return a (4, 4) pose that is turned and shifted in all axes."""
    pose = np.eye(4)
    pose[:3, :3] = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    pose[:3, 3] = rng.uniform(-20.0, 20.0, 3)
    return pose


def _beams(rng, number):
    """Return placed beams of which the last ones have another range."""
    ranges = np.where(np.arange(number) < number // 2, 0.1, 0.25)
    angles, strengths = rng.uniform(-4.0, 4.0, number), rng.randint(0, 256, (number, 40), dtype=np.uint8)
    return [
        PlacedBeam(beam_of(strength, angle, resolution), _pose(rng), bool(rng.randint(2)))
        for angle, strength, resolution in zip(angles.tolist(), strengths, ranges.tolist())
    ]


def _clouds(beams, **values):
    for kernel in Kernel:
        settings = {"end_at_full_turn": False, **values}
        assembler = ScanAssembler(SonarToCloudParameters(kernel=kernel, scan_size=len(beams), **settings))
        (cloud,) = [made for made in map(assembler.add, beams) if made is not None]
        yield cloud


@given(st.integers(0, 1000), st.integers(1, 6), st.integers(1, 3), st.sampled_from([-4.0, 0.3, 100.0]))
def test_a_scan_is_the_same(seed, number, sides, height_limit):
    beams = _beams(np.random.RandomState(seed), number)
    expected, compiled = _clouds(beams, dispersed_points=sides, height_limit=height_limit, min_range=1.0)
    assert len(compiled) == len(expected)
    np.testing.assert_allclose(compiled.points, expected.points, rtol=0.0, atol=1e-5)
    np.testing.assert_array_equal(compiled.time_stamps, expected.time_stamps)
    assert (compiled.stamp_ns, compiled.frame_id, compiled.height) == (expected.stamp_ns, expected.frame_id, 1)


@pytest.mark.parametrize("values", [{"keep_organized": True}, {"mode": "LASER"}])
def test_what_the_loops_cannot_do_is_done_by_numpy(values):
    expected, chosen = _clouds(_beams(np.random.RandomState(0), 4), **values)
    np.testing.assert_array_equal(chosen.points, expected.points)
    assert chosen.height == expected.height


def test_compiled_loops_without_numba_are_refused_in_one_line(monkeypatch):
    monkeypatch.setattr("node_support.kernels.find_spec", lambda name: None)
    with pytest.raises(ParameterError, match="kernel = NUMBA: needs numba; install it with"):
        SonarToCloudParameters(kernel="NUMBA")
