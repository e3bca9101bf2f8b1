"""Saves the map steadily, and goes on in it when the node is started again within the same run of roslaunch."""

import os
from pathlib import Path

import rospy

from mlsm_manager.localisation.localiser import Localiser
from mlsm_manager.localisation.parameters import MlsmCoreParameters
from mlsm_manager.ros.map_services import load_into, stored_map
from mlsm_manager.surface_map.export.map_folder import MapFolder
from node_support.health import Health
from node_support.parameters import ParameterError
from node_support.ros.callbacks import every


class Autosave:
    """One file for each node in map_directory, and the last one of the run before under another name."""

    def __init__(self, namespace: str, localiser: Localiser, parameters: MlsmCoreParameters, health: Health) -> None:
        """Load what a node of this name saved in this run of roslaunch, and save from now on."""
        self._localiser = localiser
        self._parameters = parameters
        self._health = health
        self._folder = MapFolder(parameters.map_directory)
        self._name = rospy.resolve_name(namespace).strip("/").replace("/", ".") + ".autosave"
        self._run = _run_of_roslaunch()
        self._saved_at = localiser.changes
        if not self._resumed() and parameters.map:
            self._start_in(parameters.map)
        if parameters.autosave_period > 0.0:
            every(parameters.autosave_period, self.save_if_changed, health)
            rospy.on_shutdown(self.save_if_changed)

    def save_if_changed(self) -> None:
        """Write the map, unless it is empty or as it was when it was written last."""
        changes = self._localiser.changes
        if changes == self._saved_at or not self._localiser.block_count:
            return
        try:
            self._folder.save(self._name, stored_map(self._localiser, self._parameters, self._run), overwrite=True)
        except (OSError, ValueError) as error:
            self._health.problem("maps not saved", f"{error}; the map would be lost if the node were killed")
            return
        self._saved_at = changes
        self._health.count("maps saved")

    def _start_in(self, name: str) -> None:
        """Load the map that the user named. Raises ParameterError where that cannot be done."""
        path = Path(name)
        if path.is_absolute() and path.parent == self._folder.folder:
            name = path.name
        try:
            load_into(self._localiser, self._folder.load(name), self._parameters, same_odometry=False)
        except ValueError as error:
            raise ParameterError(f"map = {self._parameters.map!r}: {error}") from None
        rospy.loginfo("%s: starts in %s, %d blocks", self._health.name, name, self._localiser.block_count)

    def _resumed(self) -> bool:
        """Load what this node saved in this run of roslaunch; put aside what another run left."""
        if self._parameters.autosave_period == 0.0 or not self._folder.path(self._name).exists():
            return False
        try:
            stored = self._folder.load(self._name)
            if not self._run or stored.run != self._run:
                self._folder.put_aside(self._name)
                return False
            reason = load_into(self._localiser, stored, self._parameters, same_odometry=True)
        except (OSError, ValueError) as error:
            self._health.problem("maps not resumed", f"{error}; a new map begins, the file is put aside")
            self._folder.put_aside(self._name)
            return False
        if reason:
            detail = f"{reason}; its map is kept, and the vehicle is searched in it"
            self._health.problem("runs not resumed", detail)
        self._saved_at = self._localiser.changes
        rospy.loginfo("%s: goes on in the map of %d blocks", self._health.name, self._localiser.block_count)
        return True


def _run_of_roslaunch() -> str:
    """Return a name for the run of whatever started the node; empty without a master that counts its runs.

    A roscore may outlive many runs of roslaunch, so that its own number alone does not tell them apart.
    """
    run = str(rospy.get_param("/run_id", ""))
    return f"{run} {os.getppid()}" if run else ""
