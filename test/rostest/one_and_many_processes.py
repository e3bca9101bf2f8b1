#!/usr/bin/env python3
"""A recorded tour of the basin gives the basin's walls, whether the stages share a process or not."""

import unittest
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Dict

import numpy as np
import rosbag
from graph import TEST_DATA, Inbox, launched, rows, run, wait_for_links
from playback import play
from scipy.spatial import cKDTree
from sensor_msgs.msg import Image, LaserScan, PointCloud2
from std_msgs.msg import Float32

from sonar_processing.ros.conversions import cloud_from_message
from sonar_processing.shapes.lines import LineDetector, LineDetectorParameters
from underwater_map_construction.msg import Circles, StampedIntensityCloud, Walls

HALF_LENGTH, HALF_WIDTH = 60.0, 25.0
RANGE = 50.0
ECHO_SPREAD, NOISE_SPREAD = 0.15, 4.0
CELL = 0.5
# Turns of the head in the bag, which ends in the middle of one.
SCANS = 10
BAG = TEST_DATA / "basin.bag"
N_WALLS = 2  # as match_cleaned.yaml says
SECONDS = 4.0  # between waits for slow nodes
# Of the beams, in each layout: sonar_to_cloud, and a node for images where it has one.
LISTENERS = {"one": 1, "many": 2}
# Nodes, detectors and this test that take a topic within "many".
INNER_LISTENERS = {"sonarCloud": 2, "masked": 2, "thresholded": 2, "cleaned": 3, "polar": 2, "masked/polar": 2}
MASKED = 3.02  # m around the sonar, as near_mask.yaml says
BIN = 0.1  # m
TOPICS = {
    "heard": ("/sonar/scan/sonarCloud", StampedIntensityCloud),
    "polar": ("/sonar/scan/polar", StampedIntensityCloud),
    "masked": ("/sonar/scan/masked", StampedIntensityCloud),
    "masked polar": ("/sonar/scan/masked/polar", StampedIntensityCloud),
    "cleaned": ("/sonar/scan/cleaned", StampedIntensityCloud),
    "echoes": ("/sonar/scan/echoes", StampedIntensityCloud),
    "laserScan": ("/sonar/scan/laserScan", LaserScan),
    "threshold": ("/thresholder/threshold", Float32),
    "walls": ("/sonar/scan/line/coefficients", Walls),
    "circles": ("/sonar/scan/circle/coefficients", Circles),
    "image": ("/sonar/image", Image),
}


class OneAndManyProcesses(unittest.TestCase):
    """Plays the bag to one layout after the other, once for all tests: both would publish map -> odom."""

    @classmethod
    def setUpClass(cls) -> None:
        with TemporaryDirectory() as maps:
            made = {processes: _made(processes, Path(maps) / processes) for processes in LISTENERS}
        cls.blocks = {processes: rows(messages["map"]) for processes, messages in made.items()}
        cls.beside = made

    def test_both_layouts_make_the_same_blocks(self) -> None:
        np.testing.assert_array_equal(self.blocks["one"], self.blocks["many"])

    def test_both_layouts_make_the_same_echoes_laser_scans_thresholds_and_images(self) -> None:
        one, many = self.beside["one"], self.beside["many"]
        np.testing.assert_array_equal(rows(one["echoes"].cloud), rows(many["echoes"].cloud))
        np.testing.assert_array_equal(one["laserScan"].ranges, many["laserScan"].ranges)
        self.assertEqual(one["threshold"].data, many["threshold"].data)
        self.assertEqual((one["image"].width, one["image"].encoding), (501, "mono8"))
        self.assertEqual((len(one["laserScan"].ranges), one["laserScan"].header.frame_id), (120, "sonar"))
        self.assertEqual(one["laserScan"].header.stamp, one["echoes"].header.stamp)

    def test_both_layouts_leave_out_what_the_sector_mask_covers(self) -> None:
        """The nearest bins of each beam, in scans and in whole turns; what is farther stays."""
        for made in self.beside.values():
            whole, turn = (cloud_from_message(made[name]) for name in ("polar", "masked polar"))
            left_out = (whole.valid & ~turn.valid).reshape(whole.height, -1)
            near = np.arange(1, left_out.shape[1] + 1) * BIN <= MASKED
            np.testing.assert_array_equal(left_out, near & whole.valid.reshape(left_out.shape))
            self.assertTrue(left_out.any(axis=1).all())
            scan, masked = (cloud_from_message(made[name]) for name in ("heard", "masked"))
            self.assertEqual(len(scan) - len(masked), np.count_nonzero(left_out))

    def test_both_layouts_search_the_newest_cleaned_cloud_for_walls_and_circles(self) -> None:
        for made in self.beside.values():
            found = LineDetector(LineDetectorParameters(n_walls=N_WALLS))(cloud_from_message(made["cleaned"]))
            self.assertEqual(len(made["walls"].walls), len(found))
            for shapes in (made["walls"], made["circles"]):
                self.assertEqual(shapes.header.stamp, made["cleaned"].header.stamp)

    def test_every_wall_within_range_is_there(self) -> None:
        """Each 2 m of each wall that some scan saw at less than 50 m holds a block closer than 2 m."""
        places = np.array([[0.4, 0.0], [34.4, 8.0], [-34.6, -9.0]])
        along_x, along_y = np.arange(-58.0, 58.1, 2.0), np.arange(-23.0, 23.1, 2.0)
        walls = [np.column_stack([along_x, np.full(along_x.size, side)]) for side in (-HALF_WIDTH, HALF_WIDTH)]
        walls += [np.column_stack([np.full(along_y.size, side), along_y]) for side in (-HALF_LENGTH, HALF_LENGTH)]
        for wall in walls:
            seen = wall[cKDTree(places).query(wall)[0] < RANGE - 5.0]
            self.assertGreater(len(seen), 10)
            self.assertLess(cKDTree(self.blocks["one"][:, :2]).query(seen)[0].max(), 2.0)

    def test_blocks_lie_on_the_walls_to_half_a_cell_and_outside_by_no_more_than_the_sensors_error(self) -> None:
        """Noise echoes are drawn 4 m about an echo, all others 0.15 m."""
        x, y = np.abs(self.blocks["one"][:, :2].T.astype(np.float64))
        outside = np.maximum(x - HALF_LENGTH, y - HALF_WIDTH)
        self.assertLess(outside.max(), 2.0 * NOISE_SPREAD)
        self.assertLess(np.mean(outside > 3.0 * ECHO_SPREAD + CELL), 0.03)
        long_walls = (y - HALF_WIDTH)[(x < 55) & (np.abs(y - HALF_WIDTH) < 1.5)]
        short_walls = (x - HALF_LENGTH)[(y < 20) & (np.abs(x - HALF_LENGTH) < 1.5)]
        self.assertLess(abs(np.median(long_walls)), CELL / 2)
        self.assertLess(abs(np.median(short_walls)), CELL / 2)


def _made(processes: str, folder: Path) -> Dict[str, Any]:
    """Return what a layout publishes by the end of the last turn: the newest message of each topic.

    It saves its map in `folder`, in which a node that is started again would go on in its map.
    """
    inboxes = {name: Inbox(topic, kind) for name, (topic, kind) in TOPICS.items()}
    maps = Inbox("/MLSM/cloud", PointCloud2)

    def wait() -> None:
        """Wait until all clouds that have come are searched for shapes and in the map."""
        came = inboxes["cleaned"].messages
        if came:
            inboxes["walls"].wait_for_number(len(came))
            inboxes["circles"].wait_for_number(len(came))
            maps.wait_for(lambda shown: shown.header.stamp >= came[-1].header.stamp)

    arguments = (
        f"processes:={processes}", f"parameters:={TEST_DATA}/match_cleaned.yaml", f"map_directory:={folder}",
        "sector_mask:=true", f"sector_mask_yaml:={TEST_DATA}/near_mask.yaml",
    )  # fmt: skip
    with launched("mapping.launch", "shapes:=true", *arguments):
        for inbox in (maps, *inboxes.values()):
            inbox.linked()
        for topic, listeners in INNER_LISTENERS.items() if processes == "many" else ():
            wait_for_links(f"/sonar/scan/{topic}", listeners)
        with rosbag.Bag(str(BAG)) as bag:
            moments = np.arange(bag.get_start_time(), bag.get_end_time(), SECONDS)
        play(BAG, 15.0, [(moment, wait) for moment in moments], LISTENERS[processes])
        # Images come more often than turns.
        made = {name: inbox.wait_for_number(SCANS)[-1] for name, inbox in inboxes.items()}
        stamp = made["cleaned"].header.stamp
        made["map"] = maps.wait_for(lambda cloud: cloud.header.stamp == stamp)
    for inbox in (maps, *inboxes.values()):
        inbox.close()
    return made


if __name__ == "__main__":
    run(OneAndManyProcesses)
