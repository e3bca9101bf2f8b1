"""Maps drawn from keyframes: clouds whose places may still change are kept as points and drawn anew when they do."""

from collections import deque
from dataclasses import dataclass
from typing import Deque, Dict, List, Mapping, Optional

import numpy as np

from mlsm_manager.joint_solver.parameters import SolverParameters
from mlsm_manager.localisation.clouds import MapCloud
from mlsm_manager.localisation.estimator import MapSettings
from mlsm_manager.localisation.joint_session import JointSession
from mlsm_manager.localisation.keyframe_carving import MOST_FOLLOWED, KeyframeCarving
from mlsm_manager.localisation.placement import Placement
from mlsm_manager.localisation.resumption import StoredRun
from mlsm_manager.surface_map.blocks import Blocks
from mlsm_manager.surface_map.free_space import Carver, CarveReport
from mlsm_manager.surface_map.insertion import InsertReport
from mlsm_manager.surface_map.map_file import Layer
from mlsm_manager.surface_map.mlsm import MultiLevelSurfaceMap
from mlsm_manager.surface_map.overlay import Covered, Overlay

_MOST_STORED = 500
"""Scans of a run that are stored with each save: some hours, and some tens of megabytes."""


@dataclass(frozen=True)
class Drawn:
    """report: of the newest cloud. carved: what clouds that are settled now carved; None where nothing was."""

    report: InsertReport
    carved: Optional[CarveReport]


class KeyframeMap:
    """What is settled stays in the map; above it lies what the newest keyframes add, which can be taken off again.

    The cost of drawing depends on the keyframes that are not settled, not on the map. These are drawn when somebody
    looks at the map, the others when they settle.
    """

    def __init__(
        self,
        resolution: float,
        limit: float,
        expected_blocks: int = 0,
        carver: Optional[Carver] = None,
        most_followed: int = MOST_FOLLOWED,
    ) -> None:
        """`carver`: what marks free space and takes blocks away, None for nothing. most_followed: see KeyframeCarving.

        The rest as MultiLevelSurfaceMap.
        """
        self._map = MultiLevelSurfaceMap(resolution, limit, expected_blocks)
        self._free = KeyframeCarving(resolution, limit, carver, most_followed)
        self._moving: Deque[MapCloud] = deque()
        self._overlay = Overlay(self._map)
        self._above = self._new().blocks
        self._due: Optional[Placement] = None
        self._left_out = 0

    def _new(self) -> MultiLevelSurfaceMap:
        return MultiLevelSurfaceMap(self._map.resolution, self._map.limit)

    @property
    def map(self) -> MultiLevelSurfaceMap:
        """The map with all keyframes where they are now."""
        self._draw_what_is_due()
        return self._map

    @property
    def free(self) -> KeyframeCarving:
        """The free space that all keyframes see."""
        self._draw_what_is_due()
        return self._free

    @property
    def moving(self) -> List[MapCloud]:
        """The keyframes that may still move, oldest first."""
        return list(self._moving)

    @property
    def covered(self) -> Covered:
        """What the map holds without the keyframes, in the cells that they changed."""
        self._draw_what_is_due()
        return self._overlay.covered

    def insert(self, points: np.ndarray) -> InsertReport:
        """Insert points (n, 4) in map whose places will not change."""
        return self.insert_cloud(points, np.empty(0), None).report

    def insert_cloud(self, points: np.ndarray, times: np.ndarray, origins: Optional[np.ndarray]) -> Drawn:
        """Insert points (n, 4) in map whose places will not change, of beams taken at `times` (n,) s.

        origins: (n, 2) m, where they were heard from; None where that is not known, and nothing is carved.
        """
        self._overlay.take_off()
        report = self._map.insert(points)
        if self._due is None:
            self._overlay.lay(self._above)
        return Drawn(report, None if origins is None else self.carve(points, times, origins))

    def carve(self, points: np.ndarray, times: np.ndarray, origins: np.ndarray) -> Optional[CarveReport]:
        """Carve for ever along the beams of a cloud that was inserted; see insert_cloud.

        Return None where nothing is to be carved.
        """
        self._overlay.take_off()
        carved = self._free.carve(self._map, points, times, origins)
        if self._due is None:
            self._overlay.lay(self._above)
        return carved

    def add(self, cloud: MapCloud) -> None:
        """Add a keyframe; it is in the map from the next `draw` on."""
        self._moving.append(cloud)

    def draw(self, placement: Placement, settled_until: float) -> Drawn:
        """Draw all keyframes where they are now; those that end by `settled_until` [s] stay as they are drawn.

        The others are where `placement` says when somebody looks at the map.
        """
        self._overlay.take_off()
        self._due, drawn = None, Drawn(InsertReport(0, 0, 0), None)
        while self._moving and self._moving[0].end <= settled_until:
            drawn = self._settled(self._moving.popleft(), placement, drawn.carved)
        if not self._moving:
            self._above = self._new().blocks
            return drawn
        self._due = placement
        self._left_out += 1
        return Drawn(self._map.report(placement.points(self._moving[-1])), drawn.carved)

    def settle(self, placement: Placement, until: float = np.inf) -> None:
        """Draw all keyframes that end by `until` [s] for the last time, and forget those after it."""
        self._overlay.take_off()
        while self._moving and self._moving[-1].end > until:
            self._moving.pop()
        self._free.keep_oldest(len(self._moving))
        self.draw(placement, np.inf)

    def drawn_until(self, time: float, placement: Placement) -> MultiLevelSurfaceMap:
        """Return a map of its own without the keyframes that end after `time` [s]."""
        self._overlay.take_off()
        self._due = placement if self._moving else None
        copy = self._new()
        copy.insert_blocks(self._map.blocks)
        for cloud in self._moving:
            if cloud.end <= time:
                copy.insert(placement.points(cloud))
        return copy

    def _settled(self, cloud: MapCloud, placement: Placement, before: Optional[CarveReport]) -> Drawn:
        """Draw the oldest keyframe for ever; `before`: what older ones carved."""
        self._free.forget_oldest()
        points = placement.points(cloud)
        report = self._map.insert(points)
        carved = self._free.carve(self._map, points, cloud.times, placement.origins(cloud))
        return Drawn(report, carved if before is None or carved is None else before + carved)

    def _draw_what_is_due(self) -> None:
        """Draw the keyframes that may still move, if that was put off."""
        if self._due is None:
            return
        (placement, self._due), clouds, above = (self._due, None), list(self._moving), self._new()
        everything = placement.points(MapCloud.joined(clouds))
        points = np.split(everything, np.cumsum([len(cloud) for cloud in clouds])[:-1])
        above.insert(everything)
        self._above = above.blocks
        self._overlay.lay(self._above)
        self._free.look(self._map, clouds, points, placement, self._left_out)
        self._left_out = 0
        self._overlay.hide(self._free.outworn(self._map))


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
                self.matched.add(MapCloud.of_scan(scan))
        for cloud in run.clouds:
            self.shown.add(cloud)
        self.shown.draw(session, session.settled_until)
        self.matched.draw(session, session.settled_until)
        return session

    def settle(self, session: JointSession, until: float = np.inf) -> None:
        """Draw all keyframes of a run that end by `until` [s] for the last time; those after it are forgotten."""
        self.shown.settle(session, until)
        self.matched.settle(session, until)
