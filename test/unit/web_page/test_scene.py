"""What the page is told of time, silence, checks and beams."""

import json

import numpy as np
import pytest

from node_support.health import HealthReport
from node_support.thin_queue import ThinQueue
from sonar_processing.beams.beam import Beam
from web_page.board import Board
from web_page.parameters import WebPageParameters
from web_page.scene import Scene, pooled
from web_page.stages import Stages


class _Watched:
    """A scene, a page that looks at it, and a clock that stands until it is moved."""

    def __init__(self):
        self.time, self.board, self.page = 0.0, Board(), ThinQueue(1e9)
        self.scene = Scene(WebPageParameters(), self.board, "/sonar/raw", clock=lambda: self.time)
        self.board.open(self.page, 0)

    def texts(self):
        """Return the words of all JSON messages that came since."""
        items = [one.item for one in self.page.take(self.time)]
        return {key: value for item in items if isinstance(item, str) for key, value in json.loads(item).items()}

    def now(self, stamp=0.0):
        self.scene.tell_now(stamp)
        return self.texts()["now"]


@pytest.fixture
def watched():
    return _Watched()


def _beam(angle, bins=500):
    return Beam(1, "sonar", angle, np.arange(bins, dtype=np.int64).astype(np.uint8), 0.1)


def _pose(yaw=0.0, z=-3.0):
    T = np.eye(4)
    T[:2, :2] = [[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]]
    T[:3, 3] = 1.0, 2.0, z
    return T


def test_it_says_what_it_waits_for_in_the_order_of_the_graph(watched):
    assert watched.now()["waiting"] == "waiting for beams on /sonar/raw"
    watched.scene.take_beam(_beam(0.0), np.eye(4), np.eye(4))
    assert watched.now()["waiting"] == "waiting for tf from map to base_link"
    watched.scene.take_pose(5.0, _pose())
    assert watched.now(5.0)["waiting"] == "waiting for the first scan"
    watched.scene.take_map(5.0, np.zeros((1, 2)), np.ones(1), 0.5)
    assert watched.now(5.0)["waiting"] == ""


def test_a_silent_mlsm_core_is_told(watched):
    watched.scene.take_beam(_beam(0.0), np.eye(4), np.eye(4))
    watched.scene.take_pose(5.0, _pose())
    watched.scene.take_map(5.0, np.zeros((1, 2)), np.ones(1), 0.5)
    watched.scene.take_status(0, "position good, 0.4 m", 1.0, np.eye(3))
    watched.time = 12.0
    assert watched.now(17.0)["waiting"] == "mlsm_core has said nothing for 12 s"


def test_depth_and_heading_are_as_people_read_them(watched):
    watched.scene.take_pose(5.0, _pose(yaw=np.pi, z=-3.0))
    x, y, _, depth, heading = watched.now(5.0)["pose"]
    assert (x, y, depth, heading) == (1.0, 2.0, 3.0, 270.0)


def test_north_follows_where_the_map_lies(watched):
    watched.scene.take_pose(5.0, _pose(yaw=np.pi / 2.0))
    watched.scene.take_azimuth(120.0)
    told = watched.texts()
    assert told["hello"]["azimuth"] == 120.0
    assert watched.now(5.0)["pose"][-1] == 30.0


def test_a_covariance_that_is_not_known_is_told_as_null(watched):
    watched.scene.take_status(3, "no position yet", float("nan"), np.full((3, 3), np.nan))
    now = watched.now()
    assert (now["status"]["age"], now["covariance"]) == (None, [None, None, None])


def test_time_that_jumps_back_begins_another_run_and_keeps_the_marks(watched):
    watched.scene.take_pose(1000.0, _pose())
    before = watched.board.run
    watched.scene.take_pose(10.0, _pose())
    said = watched.texts()
    assert watched.board.run != before
    assert said["hello"]["run"] == watched.board.run
    assert said["marks"] == []
    assert watched.now(11.0)["t"] == 1.0


def test_a_beam_of_another_range_ends_the_revolution(watched):
    for angle in (0.0, 1.0):
        watched.scene.take_beam(_beam(angle), np.eye(4), np.eye(4))
    watched.scene.take_beam(_beam(2.0, bins=100), np.eye(4), np.eye(4))
    beams = [one.item for one in watched.page.take(0.0) if isinstance(one.item, bytes)]
    assert len(beams) == 1


def test_the_strongest_bin_of_those_that_share_a_pixel_is_shown():
    strengths = np.zeros(1200, dtype=np.uint8)
    strengths[601] = 200
    shown = pooled(strengths)
    assert (len(shown), shown.argmax(), shown.max()) == (200, 100, 200)
    assert pooled(strengths[:50]).tolist() == strengths[:50].tolist()


def test_a_stage_is_told_with_its_checks_and_the_cause_that_is_doubted(watched):
    values = {
        "scans in": "7", "scans in per second": "0.06", "odometry decided": "fine: it is clear",
        "scans on the map": "DOUBTFUL: 20 %", "causes": "the sonar is turned by 5 deg", "blocks": "12",
    }  # fmt: skip
    Stages(watched.board, lambda: 0.0).take("mapping: mlsm_core", HealthReport(1, "running", values))
    stage = watched.texts()["stage"]
    assert stage["counts"] == [["scans in", "7", "0.06"]]
    assert stage["checks"] == [["odometry decided", "fine", "it is clear"], ["scans on the map", "DOUBTFUL", "20 %"]]
    assert stage["cause"] == "the sonar is turned by 5 deg"


def test_many_stages_and_long_words_stay_bounded(watched):
    stages = Stages(watched.board, lambda: 0.0)
    for number in range(1000):
        stages.take(f"{number} " + "x" * 10_000, HealthReport(0, "y" * 10_000, {}))
    assert watched.page.waiting_bytes < 64 * 1000 + 1000
