"""Scans, clouds and odometry in; a map and T_map_odom at any time out: the same for a live vehicle and a recording."""

import threading
import time as wall
from typing import Any, Callable, List, Mapping, Optional

import numpy as np

from mlsm_manager.localisation.live_correction import LiveCorrection
from mlsm_manager.localisation.localiser_settings import LocaliserSettings, MapInput
from mlsm_manager.localisation.map_updates import CloudUpdate, ScanUpdate, Taken
from mlsm_manager.localisation.relocalisation import relocalised
from mlsm_manager.localisation.resumption import PlaceSearch, StoredPlace
from mlsm_manager.localisation.scan_mapper import ScanMapper
from mlsm_manager.localisation.shared_map import SharedMap
from mlsm_manager.localisation.standing_correction import StandingCorrection
from mlsm_manager.localisation.timed_points import TimedPoints
from mlsm_manager.scan_matching.scan import Scan, Track
from mlsm_manager.self_check.verdict import Verdict
from mlsm_manager.surface_map.files.map_file import Layer, StoredMap
from mlsm_manager.surface_map.running_copy import finished
from node_support.errors import RefusedInput

# s: scans and odometry take different paths and can overtake each other by seconds; a restarted bag jumps by more.
_JUMP_BACK = 30.0
# s: tf keeps three minutes of odometry, and the belief must be predicted from it before they are over; but not so soon
# that scans of a fast playback on a busy machine, which are late by a minute, come after it.
_LONGEST_SILENCE = 120.0


class Localiser:
    """Safe to use from several threads: a correction can be asked for while a scan is being matched."""

    def __init__(
        self, mapper: ScanMapper, settings: LocaliserSettings, clock: Callable[[], float] = wall.monotonic
    ) -> None:
        """`clock`: s, tells how long ago the newest scan came where the odometry has no stamps."""
        self.mapper = mapper
        self._lock = threading.RLock()
        self.map = SharedMap(mapper, self._lock)
        self._live = LiveCorrection(settings.blend_time)
        self._standing = StandingCorrection(self._live, clock)
        self._newest: Optional[Scan] = None
        self._search = PlaceSearch()
        self._resumed_at: Optional[StoredPlace] = None
        self.use(settings)

    def use(self, settings: LocaliserSettings) -> None:
        """Work with other settings from the next scan on; the map stays."""
        with self._lock:
            self._settings = settings
            self.mapper.matcher = settings.matcher
            self._live.blend_time = settings.blend_time

    @property
    def matching(self) -> bool:
        """Whether scans are matched with the map, or placed by the odometry."""
        return self.mapper.matching

    def match(self, matching: bool) -> bool:
        """Turn matching on or off; return whether that is a change."""
        with self._lock:
            changed = self.mapper.matching != matching
            self.mapper.matching = matching
        return changed

    @property
    def lookahead(self) -> float:
        """Seconds of odometry after the end of a scan that are waited for before the scan is taken."""
        return self.mapper.lookahead

    def mount(self, sonar_in_base: np.ndarray) -> None:
        """Learn where the sonar is in base_link, (2,) m."""
        with self._lock:
            self.mapper.mount(sonar_in_base)

    def verdicts(self) -> List[Verdict]:
        """Return what the run says of itself, without any truth."""
        with self._lock:
            return self.mapper.verdicts()

    @property
    def believed_until(self) -> Optional[float]:
        """Time [s] of the newest belief; None before the first scan."""
        belief = self.mapper.belief
        return None if belief is None else belief.time

    def take_scan(self, scan: Scan) -> Taken:
        """Match a scan and put it, and the clouds that waited for it, into the map."""
        with self._lock:
            self.notice_time(scan.reference_time)
            self.map.change()
            self._newest = scan
            self._standing.take_scan_time(scan.reference_time)
            update = self._searched(scan) if self.is_lost else self.mapper.take_echoes(scan)
            self._search.learn(update.accepted)
            if update.belief is not None:
                self._live.believe(update.belief)
            clouds = []
            if self._settings.map_input is MapInput.MATCHED:
                clouds.append(self.mapper.take_cloud(TimedPoints.of_scan(scan)))
            clouds += iter(self.mapper.take_waiting, None)
        return Taken(update, clouds)

    def take_cloud(self, cloud: TimedPoints) -> CloudUpdate:
        """Put a cloud into the map, or let it wait for the scan of its time."""
        with self._lock:
            self.notice_time(cloud.end)
            self.map.change()
            return self.mapper.take_cloud(cloud)

    def take_placed(self, points: np.ndarray) -> CloudUpdate:
        """Put points (n, 4) that are in map already into the map."""
        with self._lock:
            self.map.change()
            return self.mapper.take_placed(points)

    def correction(self, time: float, odometry: np.ndarray) -> np.ndarray:
        """Return T_map_odom (3,) to be shown at `time` [s], when the odometry says T_odom_base (3,)."""
        return self._live.sample(time, odometry)

    def standing_correction(self, odometry: np.ndarray) -> np.ndarray:
        """Return T_map_odom (3,) to be shown now by an odometry without stamps; see StandingCorrection."""
        found = self._standing.sample(odometry)
        return self.mapper.correction if found is None else found

    def notice_time(self, time: float) -> float:
        """Return by how many seconds `time` jumped back, 0 when it did not; the place is forgotten when it did."""
        until = self.believed_until
        if until is None or time >= until - _JUMP_BACK:
            return 0.0
        with self._lock:
            self.mapper.forget_place()
            self._forget_scans()
            self._search.jump()
        return until - time

    def check_time(self, time: float) -> None:
        """Raise RefusedInput for a `time` [s] of a scan long before the belief's, which cannot be predicted back."""
        until = self.believed_until
        if until is not None and time < until - _JUMP_BACK:
            detail = f"by {until - time:.1f} s, since the odometry was followed without them; the machine is too slow"
            raise RefusedInput("scans too late", detail)

    def bridged(self, track: Track) -> Track:
        """Return a track that begins where the vehicle was when its place was stored; see StoredPlace.bridged."""
        return track if self._resumed_at is None else self._resumed_at.bridged(track)

    def silent_since(self, time: float) -> Optional[float]:
        """Return the time [s] of the belief when it is so old at `time` that `follow` must be called, else None."""
        until = self.believed_until
        return until if until is not None and time - until > _LONGEST_SILENCE else None

    def follow(self, track: Track, time: float) -> None:
        """Bring the belief to `time` [s] by the odometry, which `track` knows from `silent_since` on."""
        with self._lock:
            self.mapper.follow(track, time)

    def relocalise(self) -> Optional[ScanUpdate]:
        """Search the whole map for the newest scan, and take the place that is found as the vehicle's.

        Return None when there is no scan yet.
        """
        with self._lock:
            scan = self._newest
            if scan is None:
                return None
            update = self._found(scan)
            if update.accepted:
                self._search.forget()
                self._live.believe(update.belief)
        return update

    def _searched(self, scan: Scan) -> ScanUpdate:
        """Search the whole map for a scan, and then where the vehicle was expected: few echoes may look like chance."""
        update = self._found(scan)
        return update if update.accepted or not self._search.may_be_near else self.mapper.take_echoes(scan)

    def _found(self, scan: Scan) -> ScanUpdate:
        """Search the whole map for a scan; where it is found it goes into the map."""
        result = relocalised(scan, self.mapper.target, self._settings.anywhere, self.mapper.errors)
        return (
            self.mapper.adopt(scan, result) if result.accepted else ScanUpdate(scan, result, False, self.mapper.belief)
        )

    @property
    def is_lost(self) -> bool:
        """Whether a map was loaded, scans are matched, and the vehicle is not found in the map yet."""
        return self._search.is_lost and self.mapper.matching

    def stored(self, frame: str, calibration: Mapping[str, Any], made: float, run: str) -> StoredMap:
        """Return a copy of the map and of the place in it, to be written; see StoredMap.

        Keyframes are only stored with the name of a run of the graph, in which a node can go on with them.
        """
        with self._lock:
            belief, copies = self.mapper.belief, {layer: self.mapper.begin_copy(layer) for layer in Layer}
            keyframes = self.mapper.keyframes if run else {}
            correction = self.mapper.correction.copy()
        arrays = {} if belief is None else {**StoredPlace(correction, belief).arrays(), **keyframes}
        layers = {layer: finished(copy, self._lock) for layer, copy in copies.items()}
        return StoredMap(frame, layers, calibration, made, arrays, run)

    def restore(self, stored: StoredMap, same_odometry: bool) -> str:
        """Take a stored map in the place of the present one; return why its run cannot go on, else nothing.

        With the odometry under which it was stored the vehicle is expected where the stored correction puts it, and is
        searched everywhere too when three scans do not match there; otherwise it is searched everywhere from the start.
        Raises ValueError, and keeps the present map, for other resolutions than those of the parameters.
        """
        with self._lock:
            reason = self.mapper.restore(stored.layers, stored.arrays if same_odometry else {})
            self.map.change()
            self._forget_scans()
            self._search.lose()
            place = StoredPlace.of_arrays(stored.arrays) if same_odometry else None
            self._resumed_at = place
            if place is not None:
                self.mapper.start_from(place.widened, place.correction)
                self._live.start_from(place.correction)
                self._search.expect()
        return reason

    def clear(self) -> int:
        """Forget map and place; return how many blocks the map had."""
        with self._lock:
            count = self.mapper.block_count
            self.map.change()
            self.mapper.clear()
            self._forget_scans()
            self._search.forget()
        return count

    def _forget_scans(self) -> None:
        self._live.clear()
        self._standing.forget()
        self._newest = self._resumed_at = None
