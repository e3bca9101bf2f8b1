"""Services of the map: save, load, reset it, cut out a box, find the vehicle, name places; and saving it steadily."""

import os
import threading
import time
from dataclasses import replace
from pathlib import Path
from typing import Callable, Iterable, List, Tuple

import numpy as np
import rospy
from std_msgs.msg import ColorRGBA, Header
from std_srvs.srv import Trigger, TriggerRequest, TriggerResponse
from visualization_msgs.msg import Marker, MarkerArray

from mlsm_manager.localisation.localiser import Localiser
from mlsm_manager.localisation.parameters import MlsmCoreParameters
from mlsm_manager.localisation.updates import ScanUpdate
from mlsm_manager.ros.map_publisher import map_cloud
from mlsm_manager.surface_map.export.map_folder import MapFolder
from mlsm_manager.surface_map.map_file import StoredMap
from node_support import topics
from node_support.errors import RefusedInput
from node_support.geometry import wrapped
from node_support.health import Health
from node_support.marks import Mark, Marks
from node_support.parameters import ParameterError
from node_support.ros.callbacks import every, guarded
from underwater_map_construction import srv

_LETTER = 1.0  # m
_COLOR = ColorRGBA(0.2, 0.8, 1.0, 1.0)
_QUEUE = 100


class MapMarks:
    """The marks of the map; whoever saves or loads the map asks here."""

    def __init__(self, map_frame: str, health: Health) -> None:
        self.changes = 0
        """Grows with each change by a message."""
        self._frame, self._marks, self._lock = map_frame, Marks(), threading.Lock()
        self._shown = rospy.Publisher(topics.MARKS, MarkerArray, queue_size=_QUEUE, latch=True)
        rospy.Subscriber(topics.SET_MARK, Marker, guarded(health, self._take), queue_size=_QUEUE)

    def all(self) -> List[Mark]:
        with self._lock:
            return self._marks.all()

    def replace(self, marks: Iterable[Mark]) -> None:
        with self._lock:
            self._marks = Marks(marks)
            self._show()

    def _take(self, message: Marker) -> None:
        """Set the mark that a marker's text names at its place, or delete it."""
        if message.header.frame_id != self._frame:
            raise RefusedInput("marks refused", f"frame {message.header.frame_id!r}, must be {self._frame!r}")
        at = message.pose.position
        with self._lock:
            if message.action == Marker.DELETE:
                self._marks.delete(message.text)
            else:
                self._marks.set(Mark(message.text, at.x, at.y, at.z))
            self.changes += 1
            self._show()

    def _show(self) -> None:
        markers = [Marker(action=Marker.DELETEALL)]
        for number, mark in enumerate(self._marks.all()):
            one = Marker(header=Header(frame_id=self._frame), ns="marks", id=number, text=mark.name, color=_COLOR)
            one.type, one.scale.z, one.pose.orientation.w = Marker.TEXT_VIEW_FACING, _LETTER, 1.0
            one.pose.position.x, one.pose.position.y, one.pose.position.z = mark.x, mark.y, mark.z
            markers.append(one)
        self._shown.publish(MarkerArray(markers))


class KeptMap:
    """The localiser's map and its marks, as files of map_directory hold them."""

    def __init__(self, localiser: Localiser, parameters: MlsmCoreParameters, marks: MapMarks) -> None:
        self.localiser, self.parameters, self.marks = localiser, parameters, marks
        self.folder = MapFolder(parameters.map_directory)

    def stored(self, run: str = "") -> StoredMap:
        """Return the present map; run: see `Autosave`."""
        stored = self.localiser.stored(self.parameters.map_frame, self.parameters.calibration, time.time(), run)
        return replace(stored, marks=self.marks.all())

    def take(self, stored: StoredMap, same_odometry: bool = False) -> str:
        """Take a stored map in the place of the present one; return why its run cannot go on, else nothing.

        Raises ValueError for a map of another frame or resolution.
        """
        if stored.frame != self.parameters.map_frame:
            raise ValueError(f"frame {stored.frame!r}: must be the map's, {self.parameters.map_frame!r}")
        reason = self.localiser.restore(stored, same_odometry)
        self.marks.replace(stored.marks)
        return reason


class MapServices:
    """Serves save_map, load_map, reset_map, get_region and relocalise in the namespace of mlsm_core."""

    def __init__(
        self, namespace: str, kept: KeptMap, on_replaced: Callable[[], None], on_fix: Callable[[ScanUpdate], None]
    ) -> None:
        """`on_replaced` is called after the map was cleared or loaded, `on_fix` with the scan whose pose was found."""
        self._kept, self._localiser, self._parameters = kept, kept.localiser, kept.parameters
        self._on_replaced, self._on_fix = on_replaced, on_fix
        prefix = namespace if namespace == "~" else namespace + "/"
        rospy.Service(f"{prefix}save_map", srv.SaveMap, self._save)
        rospy.Service(f"{prefix}load_map", srv.LoadMap, self._load)
        rospy.Service(f"{prefix}reset_map", Trigger, self._reset)
        rospy.Service(f"{prefix}get_region", srv.GetRegion, self._get_region)
        rospy.Service(f"{prefix}relocalise", Trigger, self._relocalise)

    def _save(self, request: srv.SaveMapRequest) -> srv.SaveMapResponse:
        stored = self._kept.stored()
        try:
            path = self._kept.folder.save(request.name, stored, request.overwrite)
        except (OSError, ValueError) as error:
            return srv.SaveMapResponse(False, str(error))
        return srv.SaveMapResponse(True, f"{len(stored.shown)} blocks written to {path}")

    def _load(self, request: srv.LoadMapRequest) -> srv.LoadMapResponse:
        try:
            self._kept.take(self._kept.folder.load(request.name))
        except ValueError as error:
            return srv.LoadMapResponse(False, f"{error}; the present map stays")
        self._on_replaced()
        return srv.LoadMapResponse(True, f"{self._localiser.block_count} blocks loaded")

    def _reset(self, _request: TriggerRequest) -> TriggerResponse:
        count = self._localiser.clear()
        self._kept.marks.replace(())
        self._on_replaced()
        return TriggerResponse(True, f"{count} blocks deleted")

    def _get_region(self, request: srv.GetRegionRequest) -> srv.GetRegionResponse:
        low, high = (np.array([corner.x, corner.y, corner.z]) for corner in (request.low, request.high))
        if not (low <= high).all():
            corners = f"low {low.tolist()}, high {high.tolist()}"
            raise rospy.ServiceException(f"{corners}: must be numbers, low not above high")
        free = self._localiser.free.in_box(low, high) if self._parameters.cloud_free else None
        cloud = map_cloud(
            self._localiser.region(low, high), free, rospy.Time.now().to_nsec(), self._parameters.map_frame
        )
        return srv.GetRegionResponse(cloud)

    def _relocalise(self, _request: TriggerRequest) -> TriggerResponse:
        update = self._localiser.relocalise()
        if update is None:
            return TriggerResponse(False, "no scan yet")
        if not update.accepted:
            return TriggerResponse(False, f"{update.result.status.value}: {update.result.reason}")
        self._on_fix(update)
        x, y, yaw = update.result.pose
        found = f"at x {x:.2f} m, y {y:.2f} m, yaw {np.degrees(wrapped(yaw)):.1f} deg in map"
        if update.forgotten:
            apart = f"the {update.forgotten} turns of the head since the silence, which lay apart"
            found += f"; {apart}, are left out of it"
        return TriggerResponse(True, found)


class Autosave:
    """One file for each node in map_directory, and the last one of the run before under another name."""

    def __init__(self, namespace: str, kept: KeptMap, health: Health) -> None:
        """Load what a node of this name saved in this run of roslaunch, and save from now on."""
        parameters = kept.parameters
        self._kept, self._localiser, self._folder, self._health = kept, kept.localiser, kept.folder, health
        self._name = rospy.resolve_name(namespace).strip("/").replace("/", ".") + ".autosave"
        self._run = _run_of_roslaunch()
        self._saved_at = self._changes()
        if not self._resumed() and parameters.map:
            self._start_in(parameters.map)
        if parameters.autosave_period > 0.0:
            every(parameters.autosave_period, self.save_if_changed, health)
            rospy.on_shutdown(self.save_if_changed)

    def save_if_changed(self) -> None:
        """Write the map, unless it is empty or as it was when it was written last."""
        changes = self._changes()
        if changes == self._saved_at or not self._localiser.block_count:
            return
        try:
            self._folder.save(self._name, self._kept.stored(self._run), overwrite=True)
        except (OSError, ValueError) as error:
            self._health.problem("maps not saved", f"{error}; the map would be lost if the node were killed")
            return
        self._saved_at = changes
        self._health.count("maps saved")

    def _changes(self) -> Tuple[int, int]:
        return self._localiser.changes, self._kept.marks.changes

    def _start_in(self, name: str) -> None:
        """Load the map that the user named. Raises ParameterError where that cannot be done."""
        path = Path(name)
        if path.is_absolute() and path.parent == self._folder.folder:
            name = path.name
        try:
            self._kept.take(self._folder.load(name))
        except ValueError as error:
            raise ParameterError(f"map = {self._kept.parameters.map!r}: {error}") from None
        rospy.loginfo("%s: starts in %s, %d blocks", self._health.name, name, self._localiser.block_count)

    def _resumed(self) -> bool:
        """Load what this node saved in this run of roslaunch; put aside what another run left."""
        if self._kept.parameters.autosave_period == 0.0 or not self._folder.path(self._name).exists():
            return False
        try:
            stored = self._folder.load(self._name)
            if not self._run or stored.run != self._run:
                self._folder.put_aside(self._name)
                return False
            reason = self._kept.take(stored, same_odometry=True)
        except (OSError, ValueError) as error:
            self._health.problem("maps not resumed", f"{error}; a new map begins, the file is put aside")
            self._folder.put_aside(self._name)
            return False
        if reason:
            detail = f"{reason}; its map is kept, and the vehicle is searched in it"
            self._health.problem("runs not resumed", detail)
        self._saved_at = self._changes()
        rospy.loginfo("%s: goes on in the map of %d blocks", self._health.name, self._localiser.block_count)
        return True


def _run_of_roslaunch() -> str:
    """Return a name for the run of whatever started the node; empty without a master that counts its runs.

    A roscore may outlive many runs of roslaunch, so that its own number alone does not tell them apart.
    """
    run = str(rospy.get_param("/run_id", ""))
    return f"{run} {os.getppid()}" if run else ""
