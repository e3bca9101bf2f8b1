"""All that the page shows, from what the graph tells."""

import math
import os
import time
from typing import Any, Callable, Dict, List, Optional, Sequence

import numpy as np

from georeferencing.origin import EAST_DEG
from node_support.geometry import wrapped
from node_support.headers import JUMP_BACK
from node_support.marks import Mark
from sonar_processing.beams.beam import Beam
from web_page.board import BEAM, NOW, TILE, TRACK, WORDS, Board
from web_page.messages import Kind, beam_bytes, rows_bytes, text_of
from web_page.parameters import WebPageParameters
from web_page.tiles import BORN_STEP, SIDE, MapTiles

_SILENCE = 5.0  # s of wall time
_TRACK_PERIOD = 1.0  # s between two positions of the trail
_CHUNK = 32  # rows that are sent together: few, because the newest chunk goes again with each new row
_MOST_ROWS = 2048  # rows; when they are there, every second one goes
_BINS = 200  # of a beam: a pixel each where the picture is as wide as a hand
_SLOTS = 400  # directions of the bow: as fine as the finest heads step
_NARROWEST = 0.0436  # rad: width of a beam
_WIDEST_STEP = 0.2  # rad: a wider step is a gap, as where a sector begins anew


class Scene:
    """Keeps what is newest on a board; a time that jumps back begins a new run. The caller holds the board's lock."""

    def __init__(
        self, parameters: WebPageParameters, board: Board, beams: str, clock: Callable[[], float] = time.monotonic
    ) -> None:
        """beams: name of their topic."""
        self.board, self._parameters, self._clock, self._beams = board, parameters, clock, beams
        self._azimuth_deg = EAST_DEG
        self._boot, self._runs = f"{os.getpid()}.{time.time():.0f}", 0
        self._heard: Dict[str, float] = {}
        self._status: Dict[str, Any] = {}
        self._marks: Sequence[Mark] = ()
        self._cell = parameters.cell
        self._tiles = MapTiles(lambda tile, data: board.put(("tile", *tile), data, TILE))
        self._track = History(Kind.TRACK, _TRACK_PERIOD, lambda chunk, data: board.put(("track", chunk), data, TRACK))
        self._fixes = History(Kind.FIXES, 0.0, lambda chunk, data: board.put(("fixes", chunk), data, TRACK))
        self._disc = SonarDisc(
            lambda slot, data: board.put(("beam", slot), data, BEAM),
            lambda slots: board.drop([("beam", slot) for slot in slots]),
        )
        self._begin(None)

    def _begin(self, start: Optional[float]) -> None:
        """Begin a run at a time [s], None where it is not known yet."""
        self._runs += 1
        self.board.run = f"{self._boot}.{self._runs}"
        self._start = self._newest = start
        self._place: Optional[np.ndarray] = None
        self.board.clear()
        for one in (self._tiles, self._track, self._fixes):
            one.clear()
        self.hello()
        self.take_marks(self._marks)

    def hello(self) -> None:
        """Show what the page has to know first."""
        words = {
            "run": self.board.run, "cell": self._cell, "side": SIDE, "bornStep": BORN_STEP,
            "azimuth": self._azimuth_deg,
        }  # fmt: skip
        self.board.put("hello", text_of(hello=words), NOW)

    def _since_start(self, now: float) -> float:
        """Return the seconds since the run began; a time [s] that jumped back begins another."""
        if self._start is None:
            self._start = self._newest = now
        elif now < self._newest - JUMP_BACK:
            self._begin(now)
        self._newest = max(self._newest, now)
        return now - self._start

    def take_azimuth(self, azimuth_deg: float) -> None:
        """Take where the map's x axis points, clockwise from north."""
        self._azimuth_deg = azimuth_deg
        self.hello()

    def take_pose(self, now: float, T_map_base: np.ndarray) -> None:
        """Take where the vehicle is (4, 4)."""
        seconds = self._since_start(now)
        self._heard["pose"] = self._clock()
        yaw = math.atan2(T_map_base[1, 0], T_map_base[0, 0])
        self._place = np.array([*T_map_base[:3, 3], yaw])
        self._track.take((seconds, *self._place[[0, 1, 3]]))

    def take_fix(self, now: float, pose: np.ndarray, covariance: np.ndarray) -> None:
        """Take a fix x, y, yaw (3,) with its covariance (3, 3)."""
        self._heard["fix"] = self._clock()
        row = (self._since_start(now), *pose[:2], covariance[0, 0], covariance[0, 1], covariance[1, 1])
        self._fixes.take(row)

    def take_map(self, now: float, points: np.ndarray, counts: np.ndarray, cell: float) -> None:
        """Take the blocks of the map, see `MapTiles.take`."""
        seconds = self._since_start(now)
        if cell != self._cell:
            self._cell = cell
            self.hello()
        self._heard["map"] = self._clock()
        self._tiles.take(points, counts, cell, seconds)

    def take_beam(self, beam: Beam, T_base_sonar: np.ndarray, T_map_sonar: np.ndarray) -> None:
        """Take a beam, see `SonarDisc.take`."""
        self._heard["beams"] = self._clock()
        self._disc.take(beam, T_base_sonar, T_map_sonar)

    def take_status(self, state: int, text: str, age: float, covariance: np.ndarray) -> None:
        """Take state and words of PositionStatus, seconds since the fix and its covariance (3, 3)."""
        self._heard["status"] = self._clock()
        self._status = {
            "status": {"state": state, "text": text[:300], "age": age},
            "covariance": [float(covariance[at]) for at in ((0, 0), (0, 1), (1, 1))],
        }

    def take_marks(self, marks: Sequence[Mark]) -> None:
        self._marks = marks
        self.board.put("marks", text_of(marks=[[mark.name, mark.x, mark.y] for mark in marks]), WORDS)

    def tell_now(self, now: float) -> None:
        seconds = self._since_start(now) if now else 0.0
        clock = self._clock()
        words = {"t": round(seconds, 2), "ages": {name: round(clock - at, 1) for name, at in self._heard.items()}}
        words.update(cells=self._tiles.cells, fixes=len(self._fixes), waiting=self._waiting(clock))
        if self._place is not None:
            x, y, z, yaw = self._place
            heading = math.degrees(wrapped(math.radians(self._azimuth_deg) - yaw)) % 360.0
            words["pose"] = [round(float(value), 3) for value in (x, y, yaw, -z, heading)]
        self.board.pass_on("now", text_of(now={**words, **self._status}), NOW)

    def _waiting(self, clock: float) -> str:
        """Return what never came, the first in the chain; what ceased later, mlsm_core's status says."""
        frames = f"{self._parameters.map_frame} to {self._parameters.base_frame}"
        wanted = {"beams": f"beams on {self._beams}", "pose": f"tf from {frames}", "map": "the first scan"}
        missing = next((text for name, text in wanted.items() if name not in self._heard), "")
        silence = clock - self._heard.get("status", clock)
        if missing or silence <= _SILENCE:
            return missing and f"waiting for {missing}"
        return f"mlsm_core has said nothing for {silence:.0f} s"


class History:
    """Keeps rows of numbers, each with its time [s] first, and shows them in chunks.

    Memory is bounded: the older rows are, the fewer are left.
    """

    def __init__(self, kind: Kind, least: float, put: Callable[[int, bytes], None]) -> None:
        """`least`: s between two rows. `put` takes the number of a chunk that changed, and its bytes."""
        self._kind, self._first_least, self._put = kind, least, put
        self.clear()

    def clear(self) -> None:
        self._rows: List[Sequence[float]] = []
        self._least = self._first_least

    def __len__(self) -> int:
        return len(self._rows)

    def take(self, row: Sequence[float]) -> None:
        """Keep a row unless it follows the last one too soon."""
        if self._rows and row[0] - self._rows[-1][0] < self._least:
            return
        self._rows.append(row)
        if len(self._rows) < _MOST_ROWS:
            self._show((len(self._rows) - 1) // _CHUNK)
            return
        self._rows, self._least = self._rows[1::2], max(2.0 * self._least, 1e-3)
        for chunk in range(_MOST_ROWS // _CHUNK):
            self._show(chunk)

    def _show(self, chunk: int) -> None:
        rows = np.array(self._rows[chunk * _CHUNK : (chunk + 1) * _CHUNK], dtype=np.float64)
        self._put(chunk, rows_bytes(self._kind, chunk, rows.reshape(-1, len(self._rows[0]))))


class SonarDisc:
    """Makes each beam of the newest revolution ready to be drawn; the next one in its direction takes its place."""

    def __init__(self, put: Callable[[int, bytes], None], clear: Callable[[List[int]], None]) -> None:
        """`put` takes the number of a direction and the bytes of its beam, `clear` those of a revolution that ended."""
        self._put, self._clear = put, clear
        self._reach = 0.0
        self._last: Optional[float] = None

    def take(self, beam: Beam, T_base_sonar: np.ndarray, T_map_sonar: np.ndarray) -> None:
        """Take a beam and where the sonar is (4, 4) on the vehicle and in the map."""
        reach = beam.intensities.size * beam.range_resolution
        if abs(reach - self._reach) > 0.01 * reach:
            self._clear(list(range(_SLOTS)))
        self._reach = reach
        ahead = np.array([math.cos(beam.angle), math.sin(beam.angle), 0.0])
        from_bow, in_map = (math.atan2(*(turn @ ahead)[1::-1]) for turn in (T_base_sonar[:3, :3], T_map_sonar[:3, :3]))
        step = 0.0 if self._last is None else abs(wrapped(from_bow - self._last))
        self._last = from_bow
        width = max(_NARROWEST, step if step < _WIDEST_STEP else 0.0)
        slot = round(from_bow / (2.0 * math.pi) * _SLOTS) % _SLOTS
        self._put(slot, beam_bytes(reach, width, from_bow, in_map, T_map_sonar[:2, 3], pooled(beam.intensities)))


def pooled(strengths: np.ndarray) -> np.ndarray:
    """Return at most 200 strengths: of bins that share one, the strongest."""
    starts = np.unique(np.arange(_BINS) * len(strengths) // _BINS)
    return np.maximum.reduceat(strengths, starts)
