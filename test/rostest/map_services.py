#!/usr/bin/env python3
"""What the map tells the world: map -> odom steadily, all of itself to late subscribers, files where it may write."""

import shutil
import unittest
from pathlib import Path
from typing import Dict, List, Set, Tuple

import numpy as np
import rospy
from geometry_msgs.msg import Point
from graph import Inbox, publisher, run, wait_until
from messages import still_cloud
from nav_msgs.msg import MapMetaData, OccupancyGrid
from nav_msgs.srv import GetMap
from rosgraph_msgs.msg import Log
from std_msgs.msg import Bool
from std_srvs.srv import Trigger
from tf2_msgs.msg import TFMessage
from visualization_msgs.msg import Marker, MarkerArray

from mlsm_manager.surface_map.map_file import read_map
from underwater_map_construction.msg import StampedIntensityCloud
from underwater_map_construction.srv import GetRegion, LoadMap, SaveMap


def shown(arrays: List[MarkerArray]) -> Set[Tuple[float, float, float]]:
    """Return the places of the blocks that rviz shows after these messages."""
    markers: Dict[Tuple[str, int], Marker] = {}
    for marker in (marker for array in arrays for marker in array.markers):
        if marker.action == Marker.DELETEALL:
            markers.clear()
        elif marker.action == Marker.DELETE:
            markers.pop((marker.ns, marker.id), None)
        else:
            markers[marker.ns, marker.id] = marker
    return {(point.x, point.y, point.z) for marker in markers.values() for point in marker.points}


class MapServices(unittest.TestCase):
    """A map of one pillar and one floor point."""

    @classmethod
    def setUpClass(cls) -> None:
        cls.folder = Path(rospy.get_param("~folder"))
        points = np.array([[0.1, 0.1, z, 100] for z in np.arange(0, 3, 0.2)] + [[5.1, 5.1, 0, 90]], np.float32)
        cls.publisher = publisher("/sonar/scan/cleaned", StampedIntensityCloud)
        cls.publisher.publish(still_cloud(points))
        inbox = Inbox("/MLSM/Markers", MarkerArray)
        inbox.wait_for(lambda array: sum(len(marker.points) > 0 for marker in array.markers) > 1)
        inbox.close()

    @classmethod
    def tearDownClass(cls) -> None:
        shutil.rmtree(str(cls.folder), ignore_errors=True)

    def test_a_late_subscriber_sees_the_whole_map(self) -> None:
        """Though nothing changes any more, and they show true extents: 2.8 m of pillar."""
        inbox = Inbox("/MLSM/Markers", MarkerArray)
        array = inbox.wait_for(lambda array: any(marker.points for marker in array.markers))
        inbox.close()
        boxes = [(marker, point) for marker in array.markers for point in marker.points]
        piers = [(point.z, marker.scale.z / 2) for marker, point in boxes if marker.ns == "vertical"]
        self.assertAlmostEqual(max(z + half for z, half in piers), 2.8, places=5)
        self.assertAlmostEqual(min(z - half for z, half in piers), 0.0, places=5)
        self.assertEqual([marker.ns for marker, _ in boxes].count("horizontal"), 1)

    def test_the_thin_link_shows_the_same_blocks_also_after_another_map_and_to_who_comes_late(self) -> None:
        whole, thin = Inbox("/MLSM/Markers", MarkerArray), Inbox("/thin/MLSM/Markers", MarkerArray)
        wait_until(lambda: shown(thin.messages) == shown(whole.messages) != set(), told="not the same blocks")
        self.assertTrue(rospy.ServiceProxy("/mlsm_core/reset_map", Trigger)().success)
        wait_until(lambda: shown(thin.messages) == shown(whole.messages) == set(), told="not empty")
        whole.close()
        thin.close()
        self.setUpClass()

    def test_map_to_odom_comes_steadily_and_never_twice_with_one_stamp(self) -> None:
        """20 times a second, as soon as the machine lets two seconds pass at that rate."""
        inbox = Inbox("/tf", TFMessage)
        inbox.wait_for(lambda _: comes_steadily(inbox.messages))
        transforms = [message.transforms[0] for message in inbox.messages]
        stamps = [transform.header.stamp for transform in transforms]
        self.assertEqual({(t.header.frame_id, t.child_frame_id) for t in transforms}, {("map", "odom")})
        self.assertEqual(len(set(stamps)), len(stamps))

    def test_a_saved_map_can_be_loaded_and_a_damaged_one_changes_nothing(self) -> None:
        load = rospy.ServiceProxy("/mlsm_core/load_map", LoadMap)
        answer = rospy.ServiceProxy("/mlsm_core/save_map", SaveMap)("kept", False)
        self.assertTrue(answer.success, answer.message)
        self.assertEqual(sorted(read_map(self.folder / "kept.mlsm").shown.count), [1, 15])
        (self.folder / "damaged.mlsm").write_bytes((self.folder / "kept.mlsm").read_bytes()[:-40])
        answer = load("damaged")
        self.assertFalse(answer.success)
        self.assertRegex(answer.message, r"damaged\.mlsm: damaged or cut short.*; the present map stays")
        self.assertEqual(self._blocks_around(0.0), 1)
        self.assertTrue(rospy.ServiceProxy("/mlsm_core/reset_map", Trigger)().success)
        self.assertEqual(self._blocks_around(0.0), 0)
        answer = load("kept")
        self.assertTrue(answer.success, answer.message)
        self.assertEqual([self._blocks_around(place) for place in (0.0, 5.0, 9.0)], [1, 1, 0])

    def test_a_region_without_inside_is_refused_and_the_largest_is_the_whole_map(self) -> None:
        region = rospy.ServiceProxy("/mlsm_core/get_region", GetRegion)
        for low, high in ((1e300, -1e300), (float("nan"), 1.0)):
            with self.assertRaisesRegex(rospy.ServiceException, "must be numbers, low not above high"):
                region(Point(low, 0.0, 0.0), Point(high, 1.0, 1.0))
        self.assertGreater(region(Point(-1e300, -1e300, -1e300), Point(1e300, 1e300, 1e300)).cloud.width, 0)

    def _blocks_around(self, place: float) -> int:
        """Return how many blocks get_region finds within a metre of a place on the diagonal."""
        region = rospy.ServiceProxy("/mlsm_core/get_region", GetRegion)
        return region(Point(place - 1, place - 1, -5), Point(place + 1, place + 1, 5)).cloud.width

    def test_matching_is_turned_on_and_off_by_a_message(self) -> None:
        """Again and again, until the log, too, is connected."""
        starter, log = publisher("/startMatching", Bool), Inbox("/rosout", Log)

        def are_said() -> bool:
            for turned in (True, False):
                starter.publish(turned)
            said = {line.msg for line in log.messages}
            return {"mlsm_core: matching is on", "mlsm_core: matching is off"} <= said

        wait_until(are_said)

    def test_a_grid_is_sent_to_who_asks_for_it(self) -> None:
        """Two cells are occupied, nothing else is known."""
        grid = Inbox("/MLSM/grid", OccupancyGrid).wait_for(lambda grid: bool(grid.data))
        self.assertEqual((grid.info.width, grid.info.height, grid.info.resolution), (11, 11, 0.5))
        self.assertEqual([value for value in grid.data if value != -1], [100, 100])
        self.assertEqual(Inbox("/map", OccupancyGrid).wait_for().data, grid.data)
        self.assertEqual(Inbox("/map_metadata", MapMetaData).wait_for().width, 11)
        self.assertEqual(rospy.ServiceProxy("/dynamic_map", GetMap)().map.data, grid.data)


def comes_steadily(messages: List[TFMessage]) -> bool:
    """Tell whether the newest 41 transforms came 20 times a second."""
    stamps = [message.transforms[0].header.stamp.to_sec() for message in messages[-41:]]
    return len(stamps) == 41 and abs(np.median(np.diff(stamps)) - 0.05) < 0.01


if __name__ == "__main__":
    run(MapServices)
