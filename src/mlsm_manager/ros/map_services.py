"""Services of the map: save it, forget it, find the vehicle in it."""

from typing import Callable

import numpy as np
import rospy
from std_srvs.srv import Trigger, TriggerRequest, TriggerResponse

from mlsm_manager.localisation.localiser import Localiser
from mlsm_manager.localisation.mapper import ScanUpdate
from mlsm_manager.surface_map.storage import map_path, write_ply
from underwater_map_construction.srv import SaveMap, SaveMapRequest, SaveMapResponse


class MapServices:
    """Serves save_map, reset and relocalise in the namespace of mlsm_core."""

    def __init__(
        self,
        namespace: str,
        localiser: Localiser,
        save_folder: str,
        on_reset: Callable[[], None],
        on_fix: Callable[[ScanUpdate], None],
    ) -> None:
        """`on_reset` is called after the map was cleared, `on_fix` with the scan whose place was found."""
        self._localiser = localiser
        self._save_folder = save_folder
        self._on_reset = on_reset
        self._on_fix = on_fix
        prefix = namespace if namespace == "~" else namespace + "/"
        rospy.Service(f"{prefix}save_map", SaveMap, self._save)
        rospy.Service(f"{prefix}reset", Trigger, self._reset)
        rospy.Service(f"{prefix}relocalise", Trigger, self._relocalise)

    def _save(self, request: SaveMapRequest) -> SaveMapResponse:
        blocks = self._localiser.blocks
        try:
            path = map_path(self._save_folder, request.name)
            write_ply(path, blocks)
        except (OSError, ValueError) as error:
            return SaveMapResponse(False, str(error))
        return SaveMapResponse(True, f"{len(blocks)} blocks written to {path}")

    def _reset(self, _request: TriggerRequest) -> TriggerResponse:
        count = self._localiser.clear()
        self._on_reset()
        return TriggerResponse(True, f"{count} blocks deleted")

    def _relocalise(self, _request: TriggerRequest) -> TriggerResponse:
        update = self._localiser.relocalise()
        if update is None:
            return TriggerResponse(False, "no scan yet")
        if not update.accepted:
            return TriggerResponse(False, f"{update.result.status.value}: {update.result.reason}")
        self._on_fix(update)
        x, y, yaw = update.result.pose
        return TriggerResponse(True, f"at x {x:.2f} m, y {y:.2f} m, yaw {np.degrees(yaw):.1f} deg in map")
