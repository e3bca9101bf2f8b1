"""What stands in report.html."""

import base64
import json
import re
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from made_missions import mission, verdict

from mlsm_manager.report.page import Light, light_of, light_of_run, slider_json
from mlsm_manager.self_check.verdict import RunAnswer

MOST_BYTES = 15e6


@pytest.mark.parametrize(
    ("value", "limit", "more_is_better", "light"),
    [
        (1.0, 4.0, False, Light.GREEN), (3.5, 4.0, False, Light.AMBER), (4.5, 4.0, False, Light.RED),
        (1.0, 0.5, True, Light.GREEN), (0.55, 0.5, True, Light.AMBER), (0.2, 0.5, True, Light.RED),
        (np.nan, 4.0, False, Light.GREY),
    ],
)  # fmt: skip
def test_a_check_near_its_limit_is_amber_and_beyond_it_red(value, limit, more_is_better, light):
    assert light_of(verdict(value, limit, more_is_better=more_is_better)) is light


@pytest.mark.parametrize(
    ("answer", "light"),
    [
        (RunAnswer.FINE, Light.AMBER), (RunAnswer.PARTLY, Light.GREY), (RunAnswer.UNMEASURED, Light.GREY),
        (RunAnswer.DOUBTFUL, Light.RED),
    ],
)  # fmt: skip
def test_the_light_of_a_run_says_what_its_headline_says(answer, light):
    assert light_of_run(answer, [Light.GREEN, Light.AMBER]) is light
    assert light_of_run(RunAnswer.FINE, [Light.GREEN]) is Light.GREEN


def test_the_slider_begins_with_the_first_scan_and_counts_from_the_start_of_the_run():
    scans = json.loads(slider_json(mission()))["scans"]
    assert [scan["time"] for scan in scans[:2]] == [14.0, 29.0]
    assert scans[0]["vehicle"] == [pytest.approx(19.14, abs=0.01), pytest.approx(5.81, abs=0.01)]


@settings(max_examples=20)
@given(arrays(np.float64, (30, 2), elements=st.floats(-300.0, 300.0)))
def test_points_behind_the_slider_are_within_a_centimetre_of_the_scan(points):
    made = mission(scans=1)
    record = made.scans[0]
    made.scans[0] = type(record)(record.time, points, 30, 0)
    told = json.loads(slider_json(made))
    scan = told["scans"][0]
    packed = np.frombuffer(base64.b64decode(scan["points"]), "<i2").reshape(-1, 2)
    unpacked = packed * told["unit"] + np.array(scan["vehicle"])
    np.testing.assert_allclose(unpacked, points, atol=0.011)


class TestPage:
    """What people read. Needs plotly."""

    @pytest.fixture(scope="class")
    def page_of(self):
        return pytest.importorskip("mlsm_manager.report.page").report_page

    def test_text_from_outside_is_escaped(self, page_of):
        page = page_of(mission(rejections=["</script><b>"]))
        assert "<title>&lt;mission &amp; run&gt;</title>" in page
        assert "</script><b>" not in page

    @pytest.mark.parametrize(
        ("told", "shown"),
        [
            ({"verdicts": [verdict(1.0), verdict(5.0)]}, "trust: &lt;fine&gt;</p>"),
            ({}, 'title="not measured"></span> trust:'),
            ({"rejections": ["too few points"]}, "<td>14</td><td>too few points</td>"),
            (
                {"errors": {"dead_reckoning": {"mean": 6.29, "sd": 3.0, "max": 12.8}}},
                "<td>dead reckoning</td><td>6.29</td><td>3.00</td><td>12.80</td>",
            ),
        ],
        ids=["headline", "no checks, no green lamp", "rejected scans", "distances from the truth"],
    )
    def test_what_is_told_of_a_mission_is_shown(self, page_of, told, shown):
        assert shown in page_of(mission(**told))

    @pytest.mark.parametrize(
        ("name", "value", "told"),
        [
            ("range_scale_error", -0.03, "ranges of the sonar</td><td>3.0 % shorter than the sonar says"),
            ("sonar_delay", 0.98, "beams</td><td>0.98 s later than their stamps"),
            ("odometry_scale", 0.012, "distances of the odometry</td><td>1.2 % longer than the odometry says"),
            ("odometry_direction", -0.08, "direction of motion</td><td>4.6 degrees to the right of what"),
        ],
    )
    def test_the_calibration_is_told_in_units_and_words(self, page_of, name, value, told):
        assert f"<td>{told}" in page_of(replace(mission(), calibration={name: (value, 0.01)}))

    def test_what_was_no_unknown_of_the_run_is_not_told_as_calibrated(self, page_of):
        page = page_of(replace(mission(), calibration={"sonar_delay": (0.5, 0.1), "odometry_scale": (0.0, 0.0)}))
        assert "later than their stamps" in page
        assert "distances of the odometry" not in page

    def test_the_page_loads_nothing_from_elsewhere(self, page_of):
        """The library names addresses in its own text; no element of the page fetches one."""
        head, _, rest = page_of(mission()).partition("<script>")
        body = rest.partition("</script>\n</head>")[2]
        assert body
        assert not re.findall(r"(?:src|href)\s*=\s*[\"']?\s*(?!data:)\w+:", head + body)

    def test_a_map_of_300000_blocks_stays_below_15_megabytes(self, page_of):
        assert len(page_of(mission(block_count=300_000, scans=300)).encode()) < MOST_BYTES

    @pytest.mark.parametrize(("block_count", "has_height"), [(1000, True), (1, False), (0, False)])
    def test_only_a_map_with_height_is_shown_in_3d(self, page_of, block_count, has_height):
        assert ("Map in 3-D" in page_of(mission(block_count=block_count))) is has_height
