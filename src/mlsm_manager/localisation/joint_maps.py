"""The two maps of a joint run, drawn from its keyframes."""

from typing import Dict, Mapping, Optional

import numpy as np

from mlsm_manager.joint_solver.parameters import SolverParameters
from mlsm_manager.localisation.clouds import Cloud
from mlsm_manager.localisation.estimator import MapSettings
from mlsm_manager.localisation.joint_session import JointSession
from mlsm_manager.localisation.keyframe_map import KeyframeMap
from mlsm_manager.localisation.resumption import StoredRun
from mlsm_manager.surface_map.blocks import Blocks
from mlsm_manager.surface_map.map_file import Layer

_MOST_STORED = 500
"""Scans of a run that are stored with each save: some hours, and some tens of megabytes."""


class JointMaps:
    """shown: the map of clouds that is shown and saved. matched: the map of echoes in which a lost vehicle is searched.

    The matched map is carved by settled scans only: it shows nobody what may still change.
    """

    def __init__(self, settings: MapSettings) -> None:
        own = settings
        self.shown = KeyframeMap(own.resolution, own.limit, own.expected_blocks, own.carver)
        self.matched = KeyframeMap(own.match_resolution, own.limit, 0, own.carver, most_followed=0)

    @classmethod
    def of_layers(cls, settings: MapSettings, layers: Mapping[Layer, Blocks]) -> "JointMaps":
        """Return stored maps; one without a matched layer is matched with as it is shown.

        Raises ValueError for other resolutions than those of the settings.
        """
        maps, blocks = cls(settings), layers.get(Layer.SHOWN, layers.get(Layer.MATCHED))
        maps.shown.map.insert_blocks(blocks)
        maps.matched.map.insert_blocks(layers.get(Layer.MATCHED, blocks))
        if Layer.FREE in layers:
            maps.shown.free.restore(layers[Layer.FREE])
        return maps

    def stored(self, session: JointSession) -> Dict[str, np.ndarray]:
        """Return the run with what the maps hold of it, as arrays to be stored; nothing after a long run."""
        if len(session.scans) > _MOST_STORED:
            return {}
        return StoredRun(
            session.T_map_odom, session.solver.log.sonar_in_base, session.scans, session.solver.stored(),
            self.shown.moving, self.shown.covered, self.matched.covered,
        ).arrays()  # fmt: skip

    def begun(
        self, parameters: SolverParameters, sonar_in_base: np.ndarray, T_map_odom: np.ndarray,
        start: Optional[np.ndarray],
    ) -> JointSession:  # fmt: skip
        """Return a new run among the surfaces of the matched map; see JointSession.begun."""
        known = self.matched.map.blocks.mean[:, :2]
        return JointSession.begun(parameters, sonar_in_base, T_map_odom, start, known)

    def resumed(self, run: StoredRun, parameters: SolverParameters) -> JointSession:
        """Return a stored run that goes on, and draw it in these maps, which were stored with it.

        Raises ValueError, with some of it drawn already, for a run whose parts do not belong together.
        """
        try:
            session = JointSession.resumed(parameters, run.sonar_in_base, run.T_map_odom, run.scans, run.solver)
        except KeyError as error:
            raise ValueError(f"no {error} is stored") from None
        run.shown.uncover(self.shown.map)
        run.matched.uncover(self.matched.map)
        for scan in run.scans:
            if scan.reference_time > session.settled_until:
                self.matched.add(Cloud.of_scan(scan))
        for cloud in run.clouds:
            self.shown.add(cloud)
        self.shown.draw(session, session.settled_until)
        self.matched.draw(session, session.settled_until)
        return session

    def settle(self, session: JointSession, until: float = np.inf) -> None:
        """Draw all keyframes of a run that end by `until` [s] for the last time; those after it are forgotten."""
        self.shown.settle(session, until)
        self.matched.settle(session, until)
