"""The vehicle on the Earth: fixes of satellites in, latitude and longitude out."""

from typing import Optional

import numpy as np
import rospy
from sensor_msgs.msg import NavSatFix, NavSatStatus
from std_msgs.msg import Float64MultiArray

from georeferencing.adjustment import Adjusted
from georeferencing.asked import AskedOrigin, LiveOrigin
from georeferencing.fixes import fix_of
from georeferencing.origin import Origin
from mlsm_manager.localisation.localiser import Localiser
from mlsm_manager.localisation.place_now import PlaceNow, PositionState
from mlsm_manager.ros.fix_publisher import UNKNOWN_VARIANCE
from mlsm_manager.ros.odometry_track import OdometryTrack
from mlsm_manager.scan_matching.scan_path import POSITION
from node_support import topics
from node_support.geometry import composed
from node_support.health import Health
from node_support.ros.callbacks import guarded
from sonar_processing.ros.conversions import header


class ChartPosition:
    """Keeps the origin of the localiser's map up to date, and publishes the position on the Earth."""

    def __init__(
        self,
        asked: Optional[AskedOrigin],
        localiser: Localiser,
        odometry: OdometryTrack,
        base_frame: str,
        health: Health,
    ) -> None:
        """`asked`: None where the map lies where its file says, or nowhere."""
        self._asked, self._localiser, self._odometry = asked, localiser, odometry
        self._base_frame, self._health = base_frame, health
        self._live: Optional[LiveOrigin] = None
        self._own: Optional[Adjusted] = None
        self._told: Optional[Origin] = None
        self._origins = rospy.Publisher(topics.MAP_ORIGIN, Float64MultiArray, queue_size=1, latch=True)
        self._position = rospy.Publisher(topics.CHART_POSITION, NavSatFix, queue_size=2)
        if asked is not None and asked.place is None:
            rospy.Subscriber(topics.SATELLITE_FIXES, NavSatFix, guarded(health, self._take), queue_size=10)

    def tell(self, place: PlaceNow, pose: np.ndarray, state: PositionState) -> None:
        """Publish where a vehicle with `pose` (3,) in map is, as well as `place` is known."""
        guarded(self._health, self._tell)(place, pose, state)

    def _tell(self, place: PlaceNow, pose: np.ndarray, state: PositionState) -> None:
        asked = self._asked
        if self._localiser.origin is None and asked is not None and asked.place is not None:
            self._localiser.origin = asked.origin(place.time)
        origin = self._localiser.origin
        if origin is not self._told:
            self._told = origin
            self._origins.publish(Float64MultiArray(data=[] if origin is None else origin.array.tolist()))
        if origin is None:
            return
        self._health.show("origin", str(origin))
        message = NavSatFix(header=header(round(place.time * 1e9), self._base_frame))
        good = state is PositionState.GOOD
        message.status.status = NavSatStatus.STATUS_FIX if good else NavSatStatus.STATUS_NO_FIX
        message.latitude, message.longitude = origin.degrees(pose[np.newaxis])[0].tolist()
        message.altitude = np.nan
        covariance = np.diag(np.full(3, UNKNOWN_VARIANCE))
        own = self._own if self._own is not None and self._own.origin is origin else Adjusted(origin)
        covariance[:2, :2] = own.covariances(pose[np.newaxis], np.array([_variance(place)]))[0]
        message.position_covariance = covariance.ravel().tolist()
        message.position_covariance_type = NavSatFix.COVARIANCE_TYPE_KNOWN
        self._position.publish(message)

    def _take(self, message: NavSatFix) -> None:
        fix = fix_of(message)
        self._health.count("satellite fixes")
        odometry = self._odometry.track(fix.time, np.empty(0), fix.time).poses[-1]
        place = self._localiser.place_now(fix.time, odometry)
        variance = 0.0 if place is None else _variance(place)
        if self._live is None or self._own is None or self._localiser.origin is not self._own.origin:
            # A new map, or one that was loaded.
            self._live = LiveOrigin(self._asked, self._localiser.origin)
        pose = composed(self._localiser.last_correction, odometry)
        self._own = self._live.take(fix, pose[:2], variance)
        self._localiser.origin = self._own.origin


def _variance(place: PlaceNow) -> float:
    """Return that of each coordinate of a place, m^2."""
    return float(np.trace(place.covariance[POSITION, POSITION])) / 2.0
