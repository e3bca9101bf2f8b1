"""Which stamps and frames are believed."""

from contextlib import nullcontext

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from node_support.errors import RefusedInput
from node_support.headers import DAY, check_frame, check_point_stamps, check_stamp

SECOND = 10**9
NOW = 1_700_000_000 * SECOND
LAST_SAFE_NS = (2**31 - 1) * SECOND - 1


@given(st.integers(1, LAST_SAFE_NS))
def test_every_safe_stamp_passes_where_there_is_nothing_to_compare_it_with(stamp_ns):
    check_stamp(stamp_ns)


@given(st.integers(max_value=0) | st.integers(min_value=LAST_SAFE_NS + 1))
def test_a_stamp_that_tf2_cannot_subtract_is_refused(stamp_ns):
    with pytest.raises(RefusedInput, match="must be above 0 and below 2147483647 s"):
        check_stamp(stamp_ns, [stamp_ns])


@pytest.mark.parametrize(("days", "passes"), [(-1.01, False), (-0.99, True), (0.0, True), (0.99, True), (1.01, False)])
def test_a_stamp_must_be_within_a_day_of_a_reference(days, passes):
    with nullcontext() if passes else pytest.raises(RefusedInput, match="stamp_tolerance = 86400 s"):
        check_stamp(NOW + int(days * DAY * SECOND), [10 * SECOND, NOW])


@pytest.mark.parametrize(("seconds", "passes"), [(90, True), (110, False)])
def test_the_tolerance_can_be_chosen(seconds, passes):
    with nullcontext() if passes else pytest.raises(RefusedInput, match="stamp_tolerance = 100 s"):
        check_stamp(NOW + seconds * SECOND, [NOW], tolerance=100.0)


@given(st.lists(st.floats(-3600.0, 3600.0) | st.sampled_from([np.nan, np.inf, -np.inf]), max_size=5), st.booleans())
def test_times_of_points_near_the_stamp_of_their_cloud_pass(offsets, still):
    times = NOW / SECOND + np.array(offsets)
    check_point_stamps(-times if still else times, NOW)


@pytest.mark.parametrize("bad", [0.0, 1e38, -1e38, 2.0**31, 4294967295.9])
def test_one_time_far_from_the_cloud_refuses_it(bad):
    times = np.full(7, NOW / SECOND)
    times[3] = bad
    with pytest.raises(RefusedInput, match="1 of 7 timeStamps"):
        check_point_stamps(times, NOW)


@pytest.mark.parametrize("frame", ["", "/sonar", "so\0nar", "sonar\n", "\udc80"])
def test_a_frame_that_tf2_cannot_take_is_refused(frame):
    with pytest.raises(RefusedInput, match="frame_id") as refused:
        check_frame(frame, "beams refused")
    assert refused.value.kind == "beams refused"
