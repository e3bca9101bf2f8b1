"""Maps drawn from keyframes: clouds whose places may still change are kept as points and drawn anew when they do."""

from collections import deque
from dataclasses import dataclass
from typing import Deque, Dict, List, Mapping, NamedTuple, Optional

import numpy as np

from mlsm_manager.joint_solver.parameters import SolverParameters
from mlsm_manager.localisation.clouds import Placement
from mlsm_manager.localisation.joint_session import JointSession
from mlsm_manager.localisation.keyframe_traces import MOST_FOLLOWED, KeyframeCarving, Stretches
from mlsm_manager.localisation.resumption import StoredRun
from mlsm_manager.scan_matching.scan import MapCloud
from mlsm_manager.surface_map.blocks import Blocks
from mlsm_manager.surface_map.free_space import Carver, CarveReport
from mlsm_manager.surface_map.insertion import InsertReport, blocks_of
from mlsm_manager.surface_map.map_file import Layer
from mlsm_manager.surface_map.mlsm import Covered, MultiLevelSurfaceMap, Overlay


@dataclass(frozen=True)
class MapSettings:
    """The grids of the map that is shown and of the map that is matched with.

    resolution, match_resolution: side of a cell, m. limit: greatest coordinate of a point, m. expected_blocks: number
    of blocks to reserve memory for.
    carver: what marks free space and takes blocks away that beams go through; None where that is not wanted.
    """

    resolution: float
    match_resolution: float
    limit: float
    expected_blocks: int
    carver: Optional[Carver] = None


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
        stretches: Optional[Stretches] = None,
    ) -> None:
        """`carver`: what marks free space and takes blocks away, None for nothing. most_followed: see KeyframeCarving.

        stretches: what keeps settled keyframes for `redraw`; None for none. The rest as MultiLevelSurfaceMap.
        """
        self._map = MultiLevelSurfaceMap(resolution, limit, expected_blocks)
        self._free = KeyframeCarving(resolution, limit, carver, most_followed)
        self._stretches = stretches
        self._moving: Deque[MapCloud] = deque()
        self._overlay = Overlay(self._map)
        self._above = Blocks.none(resolution)
        self._due: Optional[Placement] = None
        self._left_out = 0

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
        self._overlay.take_off()
        report = self._map.insert(points)
        if self._stretches is not None:
            self._stretches.insert(points)
        if self._due is None:
            self._overlay.lay(self._above)
        return report

    def carve(self, points: np.ndarray, times: np.ndarray, origins: np.ndarray) -> Optional[CarveReport]:
        """Carve for ever along the beams of points (n, 4) that were inserted; see KeyframeCarving.carve."""
        self._overlay.take_off()
        carved = self._carved(points, times, origins)
        if self._due is None:
            self._overlay.lay(self._above)
        return carved

    def _carved(self, points: np.ndarray, times: np.ndarray, origins: np.ndarray) -> Optional[CarveReport]:
        """As `carve` while only what is settled is in the map."""
        report, noted = self._free.carve(self._map, points, times, origins)
        if self._stretches is not None and noted is not None:
            self._stretches.note_free(noted)
        return report

    def add(self, cloud: MapCloud) -> None:
        """Add a keyframe; it is in the map from the next `draw` on."""
        self._moving.append(cloud)

    def draw(self, placement: Placement, settled_until: float) -> Optional[CarveReport]:
        """Draw all keyframes where they are now; those that end by `settled_until` [s] stay as they are drawn.

        The others are where `placement` says when somebody looks at the map. Return what those that are settled now
        carved; None where nothing was.
        """
        self._overlay.take_off()
        carved = None
        while self._moving and self._moving[0].end <= settled_until:
            cloud = self._moving.popleft()
            self._free.forget_oldest()
            points, origins = placement.heard(cloud)
            self._map.insert(points)
            if self._stretches is not None:
                self._stretches.add(cloud.end, points, placement, len(self._map))
            report = self._carved(points, cloud.times, origins)
            carved = report if carved is None else carved + report
        if self._moving:
            self._due = placement
            self._left_out += 1
        else:
            self._due, self._above = None, Blocks.none(self._map.resolution)
        return carved

    def settle(self, placement: Placement, until: float = np.inf) -> None:
        """Draw all keyframes that end by `until` [s] for the last time, and forget those after it."""
        self._overlay.take_off()
        while self._moving and self._moving[-1].end > until:
            self._moving.pop()
        self._free.keep_oldest(len(self._moving))
        self.draw(placement, np.inf)
        self._stretches = None

    def redraw(self, placement: Placement) -> None:
        """Draw also what is settled anew, where the path is now; without stretches that stays where it is."""
        self._overlay.take_off()
        if self._stretches is not None:
            self._stretches.redraw(self._map, self._free.settled, placement)
        self._free.keep_oldest(0)
        self._due = placement if self._moving else None

    def drawn_until(self, time: float, placement: Placement) -> MultiLevelSurfaceMap:
        """Return a map of its own without the keyframes that end after `time` [s]."""
        self._overlay.take_off()
        self._due = placement if self._moving else None
        copy = MultiLevelSurfaceMap(self._map.resolution, self._map.limit)
        copy.insert_blocks(self._map.blocks)
        for cloud in self._moving:
            if cloud.end <= time:
                copy.insert(placement.heard(cloud)[0])
        return copy

    def _draw_what_is_due(self) -> None:
        if self._due is None:
            return
        placement, self._due = self._due, None
        together = MapCloud.joined(self._moving)
        points, origins = placement.heard(together)
        self._above = blocks_of(points, self._map.resolution, self._map.limit)
        self._overlay.lay(self._above)
        ends = np.cumsum([len(cloud) for cloud in self._moving])
        keyframes = zip(*(np.split(each, ends[:-1]) for each in (points, together.times, origins)))
        self._free.look(self._map, list(keyframes), self._left_out)
        self._left_out = 0
        self._overlay.hide(*self._free.outworn(self._map))


class KeyframeMaps(NamedTuple):
    """shown: the map of clouds that is shown and saved. matched: the map of echoes in which a lost vehicle is searched.

    The matched map is carved by settled scans only: it shows nobody what may still change.
    """

    shown: KeyframeMap
    matched: KeyframeMap

    @classmethod
    def empty(cls, own: MapSettings, bends: bool) -> "KeyframeMaps":
        """bends: whether what is settled may move with the path, for `redraw`."""
        sides = own.resolution, own.match_resolution
        shown, matched = (Stretches(resolution) if bends else None for resolution in sides)
        return cls(
            KeyframeMap(own.resolution, own.limit, own.expected_blocks, own.carver, stretches=shown),
            KeyframeMap(own.match_resolution, own.limit, 0, own.carver, most_followed=0, stretches=matched),
        )

    @classmethod
    def of_layers(cls, settings: MapSettings, layers: Mapping[Layer, Blocks], bends: bool) -> "KeyframeMaps":
        """Return stored maps; one without a matched layer is matched with as it is shown.

        Raises ValueError for other resolutions than those of the settings.
        """
        maps, blocks = cls.empty(settings, bends), layers.get(Layer.SHOWN, layers.get(Layer.MATCHED))
        maps.shown.map.insert_blocks(blocks)
        maps.matched.map.insert_blocks(layers.get(Layer.MATCHED, blocks))
        if Layer.FREE in layers:
            maps.shown.free.restore(layers[Layer.FREE])
        return maps

    def stored(self, session: JointSession) -> Dict[str, np.ndarray]:
        """Return the run with what the maps hold of it, as arrays to be stored; nothing after a long run."""
        if not session.may_be_stored:
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
        for drawn in self:
            drawn.draw(session, session.settled_until)
        return session
