"""Tells the position as it is known now: in words, as a pose with its covariance, and in rviz at the vehicle."""

import time
from textwrap import fill
from typing import List, Optional, Sequence, Tuple

import numpy as np
import rospy
from geometry_msgs.msg import Point, PoseWithCovarianceStamped, Vector3
from std_msgs.msg import ColorRGBA, Header
from visualization_msgs.msg import Marker, MarkerArray

from mlsm_manager.localisation.localiser import Localiser
from mlsm_manager.localisation.place_now import PlaceNow, PositionState, doubts_of, position_state, report_place
from mlsm_manager.localisation.updates import report_causes
from mlsm_manager.ros.chart_position import ChartPosition
from mlsm_manager.ros.fix_publisher import MapTransform, pose_covariance
from mlsm_manager.ros.odometry_track import OdometryTrack, planar
from mlsm_manager.self_check.verdict import Verdict
from node_support import topics
from node_support.geometry import matrices
from node_support.headers import DAY
from node_support.health import Health
from node_support.ros.callbacks import every
from node_support.ros.transforms import pose_from_matrix
from sonar_processing.ros.conversions import header
from underwater_map_construction.msg import PositionStatus

_PERIOD = 1.0  # s
_REST = 5.0  # times as long as a look for causes lasts, until the next one
_AMBER = ColorRGBA(1.0, 0.75, 0.1, 1.0)
_COLORS = {
    PositionState.GOOD: ColorRGBA(0.35, 0.9, 0.4, 1.0),
    PositionState.PROVISIONAL: _AMBER,
    PositionState.DOUBTFUL: _AMBER,
    PositionState.UNKNOWN: ColorRGBA(1.0, 0.3, 0.25, 1.0),
}
_WHITE, _GREY = ColorRGBA(0.9, 0.92, 0.95, 1.0), ColorRGBA(0.6, 0.65, 0.7, 0.7)
_SHARE = 20.0  # of how far the sonar hears: the height of a letter, from which all else follows
_MOST = 2.5  # m, of a letter: larger ones hide the map
_LINE, _THIN = 0.08, 0.03  # letters: width of a line, and of one of the grid
_VEHICLE, _ABOVE = 2.0, 1.5  # letters: length of the vehicle's arrow, height over it
_ASIDE = (-6.0, -7.0)  # letters from the vehicle, where scale bar and north arrow begin
_GRID, _LABELS = 30.0, (18.0, 12.0)  # letters from the vehicle: where lines of the grid end and are labelled
_BARS = (0.1, 1.0, 10.0)  # m: the longest one that eight letters hold is drawn
_WITHIN = float(np.sqrt(-2.0 * np.log(0.05)))  # deviations of a plane's ellipse that holds 95 %
_ROUND = np.linspace(0.0, 2.0 * np.pi, 49)
_WIDEST = 52  # letters of a line of the status


class StatusTeller:
    """Tells each second how old and how good the position is: on /diagnostics, /MLSM/status and /MLSM/pose_now.

    It does so by the wall clock, and goes on while no scan, no odometry and no other clock come. verdicts: what the run
    says of itself. stages_before: of the same process, whose inputs must come too.
    """

    def __init__(
        self, localiser: Localiser, odometry: OdometryTrack, transform: MapTransform, chart: ChartPosition,
        map_frame: str, health: Health,
    ) -> None:  # fmt: skip
        self.verdicts: Sequence[Verdict] = ()
        self.is_provisional = False
        self.stages_before: Sequence[Health] = ()
        self._localiser, self._odometry, self._transform = localiser, odometry, transform
        self._chart = chart
        self._health, self._map_frame = health, map_frame
        self._status = rospy.Publisher(topics.POSITION_STATUS, PositionStatus, queue_size=10, latch=True)
        self._pose = rospy.Publisher(topics.POSE_NOW, PoseWithCovarianceStamped, queue_size=2)
        self._markers = rospy.Publisher(topics.STATUS_MARKERS, MarkerArray, queue_size=2)
        self._letter = 0.0
        self._next_look = -np.inf
        every(_PERIOD, self.tell, health)
        every(_PERIOD, self._look, health)

    def hear(self, distances: np.ndarray) -> None:
        """Learn how far (n,) [m] the echoes of a scan are: as large as these is what is drawn, and never smaller."""
        if len(distances):
            self._letter = max(self._letter, min(float(np.quantile(distances, 0.9)) / _SHARE, _MOST))

    def tell(self) -> None:
        """Publish how well the position is known now."""
        place, T_map_base = self._place_now()
        if place is not None:
            report_place(self._health, place)
        following = self._localiser.following
        causes, assumed = following.causes(), following.found.assumed
        report_causes(self._health, causes, assumed)
        stages = (*self.stages_before, self._health)
        silent = {topic: seconds for stage in stages for topic, seconds in stage.silent().items()}
        doubts = doubts_of(place, causes, self.verdicts, silent, self._odometry.name)
        state, text = position_state(place, self._localiser.is_lost, self.is_provisional, doubts, assumed)
        self._health.show("position", text)
        self._publish(state, text, place, T_map_base)

    def _look(self) -> None:
        """Look for causes, for no more than a small share of the time: other nodes need the core, too."""
        begin = time.monotonic()
        if begin >= self._next_look:
            self._localiser.look_for_causes()
            self._next_look = time.monotonic() + _REST * (time.monotonic() - begin)

    def _place_now(self) -> Tuple[Optional[PlaceNow], Optional[np.ndarray]]:
        """Return how good the position is, and T_map_base (4, 4) as tf tells it; None for what is not known."""
        newest, now = self._odometry.newest(), rospy.Time.now().to_sec()
        if newest is None:
            return None, None
        known, T_odom_base = newest
        if known is None:
            known = self._localiser.believed_until or now
        # Stamps of another clock are as far off as no silence lasts: then the odometry tells the time.
        time = now if 0.0 < now - known < DAY else known
        T_map_base = matrices(self._transform.newest) @ T_odom_base
        return self._localiser.place_now(time, planar(T_odom_base)), T_map_base

    def _publish(
        self, state: PositionState, text: str, place: Optional[PlaceNow], T_map_base: Optional[np.ndarray]
    ) -> None:  # fmt: skip
        time = rospy.Time.now().to_sec() if place is None else place.time
        status = PositionStatus(header=header(round(time * 1e9), self._map_frame), state=state, text=text)
        status.age = np.nan if place is None else place.age
        status.covariance = np.full(9, np.nan) if place is None else place.covariance.ravel()
        self._status.publish(status)
        if place is not None:
            told = PoseWithCovarianceStamped(header=status.header)
            told.pose.pose, told.pose.covariance = pose_from_matrix(T_map_base), pose_covariance(place.covariance)
            self._pose.publish(told)
            self._chart.tell(place, planar(T_map_base), state)
        if T_map_base is not None and self._markers.get_num_connections():
            letter = self._letter or _MOST
            self._markers.publish(MarkerArray(status_markers(status, T_map_base, letter, self._map_frame)))


def status_markers(status: PositionStatus, T_map_base: np.ndarray, letter: float, frame: str) -> List[Marker]:
    """Return what is drawn in place of all before: a grid at the vehicle's depth, its labels and the status over it.

    letter: m, the height of one, in which all but the ellipse and the distances of lines are measured.
    """
    length = max([bar for bar in _BARS if bar <= 8.0 * letter], default=_BARS[0])
    place, over = T_map_base[:3, 3], np.array([0.0, 0.0, _ABOVE * letter])
    below, above = _Maker(frame, "grid", place, letter), _Maker(frame, "status", place + over, letter)
    drawn = [*_grid(below, above, place[:2], length), *_status(above, status, T_map_base[:2, 0], length)]
    return [Marker(header=Header(frame_id=frame), action=Marker.DELETEALL), *drawn]


def _grid(below: "_Maker", above: "_Maker", vehicle: np.ndarray, step: float) -> List[Marker]:
    """Return lines of the map's x and y each `step` metres, and above the map what x and y they are."""
    letter = below.letter
    low, high = (step * np.round((vehicle + way * np.multiply(_LABELS, letter)) / step) for way in (-1.0, 1.0))
    end, ends, labels = _GRID * letter, [], []
    for axis in (0, 1):
        first, last = np.ceil((vehicle[axis] - end) / step), np.floor((vehicle[axis] + end) / step)
        for value in step * np.arange(first, last + 1.0) + 0.0:
            line = np.array([[-end, -end], [end, end]])
            line[:, axis] = value - vehicle[axis]
            ends.append(line)
            if low[axis] < value <= high[axis]:
                place = np.where(np.arange(2) == axis, value, low) - vehicle
                labels.append(above.text(f"{value:.{int(step < 1.0)}f}", place, _GREY))
    return [below.line(np.concatenate(ends), _GREY, kind=Marker.LINE_LIST, width=_THIN), *labels]


def _status(made: "_Maker", status: PositionStatus, ahead: np.ndarray, length: float) -> List[Marker]:
    """Return status text, vehicle, scale bar, north arrow and ellipse.

    ahead: (2,) where the vehicle looks, of length 1. length: m, of the scale bar.
    """
    color, letter = _COLORS[PositionState(status.state)], made.letter
    half, origin = np.multiply(ahead, _VEHICLE * letter / 2.0), np.multiply(_ASIDE, letter)
    bar, north = (np.array([origin, np.add(origin, way)]) for way in ((length, 0.0), (0.0, 2.5 * letter)))
    text = fill(status.text, _WIDEST, break_long_words=False, break_on_hyphens=False)
    fix = f"\nfix {status.age:.0f} s ago" if np.isfinite(status.age) else ""
    markers = [
        made.text(text + fix, np.array([0.0, 2.5 * letter]), color),
        made.arrow(np.array([-half, half]), color),
        made.line(bar, _WHITE),
        made.text(f"{length:g} m", np.add(bar[1], (1.2 * letter, 0.0)), _WHITE),
        made.arrow(north, _WHITE),
        made.text("N", np.add(north[1], (0.0, 0.6 * letter)), _WHITE),
    ]
    covariance = np.reshape(status.covariance, (3, 3))[:2, :2]
    return [*markers, *([made.line(ellipse(covariance), color)] if np.isfinite(covariance).all() else [])]


def ellipse(covariance: np.ndarray) -> np.ndarray:
    """Return the line (n, 2) [m] around 0 within which a position with a covariance (2, 2) lies with 95 %."""
    values, vectors = np.linalg.eigh(covariance)
    axes = _WITHIN * np.sqrt(np.maximum(values, 0.0))
    return (np.column_stack([np.cos(_ROUND), np.sin(_ROUND)]) * axes) @ vectors.T


class _Maker:
    """Makes markers of one name around a place (3,) in the map, numbered as they are made; letter: m, height of one."""

    def __init__(self, frame: str, name: str, origin: np.ndarray, letter: float) -> None:
        self._frame, self._name, self._origin, self._number, self.letter = frame, name, origin, 0, letter

    def _marker(self, kind: int, color: ColorRGBA) -> Marker:
        self._number += 1
        # Stamp 0: shown at once, also where rviz has the newest transforms of map a moment later.
        marker = Marker(header=Header(frame_id=self._frame), ns=self._name, id=self._number, type=kind, color=color)
        marker.pose.orientation.w = 1.0
        return marker

    def _points(self, places: np.ndarray) -> List[Point]:
        x, y, z = self._origin
        return [Point(x + one, y + other, z) for one, other in places]

    def text(self, text: str, place: np.ndarray, color: ColorRGBA) -> Marker:
        """Return a text at a place (2,) [m] from the origin."""
        marker = self._marker(Marker.TEXT_VIEW_FACING, color)
        marker.text, marker.scale.z = text, self.letter
        (marker.pose.position,) = self._points([place])
        return marker

    def line(self, places: np.ndarray, color: ColorRGBA, kind: int = Marker.LINE_STRIP, width: float = _LINE) -> Marker:
        """Return a line along places (n, 2) [m] from the origin; of LINE_LIST one between each two."""
        marker = self._marker(kind, color)
        marker.scale.x, marker.points = width * self.letter, self._points(places)
        return marker

    def arrow(self, ends: Sequence[np.ndarray], color: ColorRGBA) -> Marker:
        """Return an arrow between two places (2,) [m] from the origin."""
        marker = self._marker(Marker.ARROW, color)
        width = _LINE * self.letter
        marker.scale, marker.points = Vector3(3.0 * width, 8.0 * width, 10.0 * width), self._points(ends)
        return marker
