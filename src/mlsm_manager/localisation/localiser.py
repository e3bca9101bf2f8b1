"""Scans, clouds and odometry in; a map and T_map_odom at any time out: the same for a live vehicle and a recording."""

from collections import deque
from dataclasses import dataclass, replace
from enum import Enum
from threading import RLock
from time import monotonic
from typing import Any, Callable, Deque, Iterable, List, Mapping, Optional, Tuple

import numpy as np

from georeferencing.origin import STORED, Origin
from mlsm_manager.joint_solver.solution import Solution
from mlsm_manager.localisation.estimator import Estimator
from mlsm_manager.localisation.following import Following
from mlsm_manager.localisation.joint_session import belief_at
from mlsm_manager.localisation.lost_vehicle import PlaceSearch
from mlsm_manager.localisation.place_now import PlaceNow
from mlsm_manager.localisation.resumption import StoredPlace
from mlsm_manager.localisation.updates import CloudUpdate, ScanResult, ScanUpdate
from mlsm_manager.odometry.steps import MotionLimits
from mlsm_manager.scan_matching.scan import Belief, MapCloud, Matcher, Scan, Track
from mlsm_manager.scan_matching.scan_path import POSE
from mlsm_manager.self_check.verdict import Verdict
from mlsm_manager.surface_map.block_store import finished
from mlsm_manager.surface_map.blocks import Blocks
from mlsm_manager.surface_map.map_file import Layer, StoredMap
from node_support.errors import RefusedInput
from node_support.geometry import composed, move_of

# s: scans and odometry take different paths and can overtake each other by seconds; a restarted bag jumps by more.
_JUMP_BACK = 30.0
_LEAP = 600.0  # s: by more an odometry that goes on leaps only where its clock does
_SAME_BEGIN = 60.0  # s: two playbacks of a recording begin within a turn or two of the head
# s: tf keeps three minutes of odometry, and the belief must be predicted from it before they are over; but not so soon
# that scans of a fast playback on a busy machine, which are late by a minute, come after it.
_LONGEST_SILENCE = 120.0
_TURNS_COMPARED = 40  # turns of the head in which causes are looked for: ten minutes
_NEWEST = 3  # scans in which a vehicle is searched on request; two must be found


class MapInput(Enum):
    """Which points make the map that is shown and saved."""

    CLEANED = "CLEANED"
    MATCHED = "MATCHED"


@dataclass(frozen=True)
class LocaliserSettings:
    """What a localiser can be told, also while it runs.

    matcher: for scans near their expected place. anywhere: for a vehicle that is lost. blend_time: s, within which the
    correction goes over to a new one.
    """

    matcher: Matcher
    anywhere: Matcher
    blend_time: float
    map_input: MapInput


class Localiser:
    """Safe to use from several threads: a correction can be asked for while a scan is being matched.

    changes: a number that grows whenever the map or the pose in it changes. following: what is known between scans.
    origin: where the map lies on the Earth, where that is known.
    """

    def __init__(
        self,
        estimator: Estimator,
        settings: LocaliserSettings,
        limits: MotionLimits,
        clock: Callable[[], float] = monotonic,
    ) -> None:
        """limits: of the odometry's steps; those beyond are left out.

        clock: s, tells how long ago the newest scan came where the odometry has no stamps.
        """
        self.estimator = estimator
        self._lock = RLock()
        self.changes = 0
        self.following = Following(limits, settings.blend_time, clock)
        self._newest: Deque[Scan] = deque(maxlen=_NEWEST)
        self._search = PlaceSearch()
        self._began = np.inf
        self.origin: Optional[Origin] = None
        self.use(settings)

    def use(self, settings: LocaliserSettings) -> None:
        """Work with other settings from the next scan on; the map stays."""
        with self._lock:
            self._settings = settings
            self.estimator.matcher = settings.matcher
            self.following.live.blend_time = settings.blend_time

    def match(self, matching: bool) -> bool:
        """Turn matching on or off; return whether that is a change.

        Without it scans are not compared, also for causes of errors: a sonar that tilts hears other things each turn.
        """
        with self._lock:
            changed = self.estimator.matching != matching
            self.estimator.matching = matching
        return changed

    def mount(self, sonar_in_base: np.ndarray) -> None:
        """Learn where the sonar is in base_link, (2,) m."""
        with self._lock:
            self.estimator.sonar_in_base = self.following.found.sonar_in_base = sonar_in_base

    @property
    def odometry(self) -> str:
        """What was found out about the odometry, as text for people; empty where nothing had to be."""
        with self._lock:
            return self.estimator.odometry

    def look_for_causes(self) -> None:
        """Look in the newest scans for what is wrong; takes seconds of a core where something is."""
        self.following.found.look(self._newest_run, list(self.following.odometry.steps))

    def _newest_run(self) -> Optional[Solution]:
        with self._lock:
            session = self.estimator.session
            return None if session is None else session.newest_run(_TURNS_COMPARED)

    def verdicts(self) -> List[Verdict]:
        """Return what the run says of itself, without any truth."""
        with self._lock:
            session = self.estimator.session
            return [] if session is None else session.verdicts()

    @property
    def believed_until(self) -> Optional[float]:
        """Time [s] of the newest belief; None before the first scan."""
        belief = self.estimator.belief
        return None if belief is None else belief.time

    def take_scan(self, scan: Scan) -> ScanResult:
        """Match a scan and put it, and the clouds that waited for it, into the map."""
        with self._lock:
            self.notice_time(scan.reference_time)
            self.changes += 1
            self._began = min(self._began, scan.start)
            reported, scan = scan, self.following.taken(scan)
            self._newest.append(scan)
            update = self._searched([scan], self._search) if self.is_lost else None
            # Few echoes may look like chance in the whole map, but not where the vehicle was expected.
            if update is None or (self._search.may_be_near and not update.accepted):
                update = self.estimator.add_scan(scan)
            self._search.learn(update.accepted)
            update = self.following.learned(scan, update, self.estimator.matching)
            clouds = []
            if self._settings.map_input is MapInput.MATCHED:
                clouds.append(self.estimator.add_cloud(MapCloud.of_scan(scan)))
            clouds += iter(self.estimator.add_waiting, None)
        return ScanResult(replace(update, scan=reported), clouds)

    def take_cloud(self, cloud: MapCloud) -> CloudUpdate:
        """Put a cloud into the map, or let it wait for the scan of its time."""
        with self._lock:
            self.notice_time(cloud.end)
            self.changes += 1
            return self.estimator.add_cloud(self.following.cloud(cloud))

    def take_points(self, points: np.ndarray) -> CloudUpdate:
        """Put points (n, 4) that are in map already into the map."""
        with self._lock:
            self.changes += 1
            return self.estimator.add_points(points)

    @property
    def last_correction(self) -> np.ndarray:
        """T_map_odom (3,) as the newest scan told it."""
        return composed(self.estimator.correction, self.following.odometry.fixes(np.array(np.inf)))

    def place_now(self, time: float, odometry: np.ndarray) -> Optional[PlaceNow]:
        """Return how old and how good the position is at `time` [s], when the odometry says T_odom_base (3,).

        None before the first fix.
        """
        with self._lock:
            belief = self.estimator.belief
            return None if belief is None else self.following.place_at(time, odometry, belief, self.estimator.errors)

    def notice_time(self, time: float, odometry: Optional[np.ndarray] = None) -> float:
        """Return by how many seconds `time` jumped back, 0 when it did not; the place is forgotten when it did.

        odometry: T_odom_base (3,) of that time, where `time` is its own. Where it goes on as if nothing had happened
        only the clock jumped, back or far forward, and the vehicle is expected where it was. A recording that is played
        again begins where it began before; otherwise the vehicle may be anywhere, and the whole map is searched.
        """
        until = self.believed_until
        if until is None or until - _JUMP_BACK <= time <= until + _LEAP:
            return 0.0
        with self._lock:
            goes_on = odometry is not None and self.following.odometry.goes_on_at(odometry)
            if time > until and not goes_on:
                return 0.0
            place = StoredPlace(self.last_correction, self.estimator.belief)
            self._forget_place()
            if goes_on:
                self._expect(place.correction, place.widened)
            elif not self._search.is_known or abs(time - self._began) > _SAME_BEGIN:
                self._search.lose()
        return until - time

    def expect(self, pose: np.ndarray, covariance: np.ndarray, odometry: np.ndarray) -> None:
        """Take T_map_base `pose` (3,), with its covariance (3, 3), as where somebody sees the vehicle now.

        The next scan is searched about there. odometry: T_odom_base (3,) now.
        """
        with self._lock:
            belief = belief_at(np.nan, pose, self.estimator.errors)
            belief.covariance[POSE, POSE] = covariance
            self._forget_place()
            self._expect(move_of(odometry, pose), belief)

    def _forget_place(self) -> None:
        self.estimator.forget_place()
        self._forget_scans()

    def _expect(self, correction: np.ndarray, belief: Belief) -> None:
        self.estimator.start_from(belief, correction)
        self.following.live.start_from(correction)
        self._search.expect()

    def check_time(self, time: float) -> None:
        """Raise RefusedInput for a `time` [s] of a scan long before the belief's, which cannot be predicted back."""
        until = self.believed_until
        if until is not None and time < until - _JUMP_BACK:
            detail = f"by {until - time:.1f} s, since the odometry was followed without them; the machine is too slow"
            raise RefusedInput("scans too late", detail)

    def silent_since(self, time: float) -> Optional[float]:
        """Return the time [s] of the belief when it is so old at `time` that `follow` must be called, else None."""
        until = self.believed_until
        return until if until is not None and time - until > _LONGEST_SILENCE else None

    def follow(self, track: Track, time: float) -> None:
        """Bring the belief to `time` [s] by the odometry, which `track` knows from `silent_since` on."""
        with self._lock:
            self.estimator.follow(self.following.followed(track, time), time)

    def relocalise(self) -> Optional[ScanUpdate]:
        """Search the whole map for the newest scans, and take a place that two of them tell as the vehicle's.

        Return None when there is no scan yet.
        """
        with self._lock:
            if not self._newest:
                return None
            update = self._searched(self._newest, PlaceSearch())
            if update.accepted:
                self._search.forget()
                self.following.live.believe(update.belief)
        return update

    def _searched(self, scans: Iterable[Scan], search: PlaceSearch) -> ScanUpdate:
        """Search the whole map for scans one after the other; where the last one is found the vehicle is."""
        estimator = self.estimator
        for scan in scans:
            result = search.found(scan, estimator.target, self._settings.anywhere, estimator.errors)
        if result.accepted:
            return estimator.adopt(scan, result)
        return ScanUpdate(scan, result, False, estimator.belief)

    @property
    def is_lost(self) -> bool:
        """Whether a map was loaded, scans are matched, and the vehicle is not found in the map yet."""
        return self._search.is_lost and self.estimator.matching

    @property
    def is_expected(self) -> bool:
        """Whether the next scans are searched about where the vehicle is expected."""
        return self._search.may_be_near

    @property
    def blocks(self) -> Blocks:
        """A copy of the map that is shown and saved."""
        return self._copied(Layer.SHOWN)

    @property
    def free(self) -> Blocks:
        """A copy of what is known to be free."""
        return self._copied(Layer.FREE)

    @property
    def block_count(self) -> int:
        with self._lock:
            return len(self.estimator.shown)

    def region(self, low: np.ndarray, high: np.ndarray) -> Blocks:
        """Return the blocks of the map that is shown whose mean lies from `low` to `high`, (2,) or (3,) m."""
        with self._lock:
            return self.estimator.shown.in_box(low, high)

    def changed_tiles(self) -> Tuple[np.ndarray, Blocks]:
        """Return the tiles (n, 2) of the map that is shown that changed since the last call, and their blocks."""
        with self._lock:
            shown = self.estimator.shown
            tiles = shown.take_changed_tiles()
            return tiles, shown.in_tiles(tiles)

    def _copied(self, layer: Layer) -> Blocks:
        with self._lock:
            copy = self.estimator.map_of(layer).begin_copy()
        return finished(copy, self._lock)

    def stored(self, frame: str, calibration: Mapping[str, Any], made: float, run: str) -> StoredMap:
        """Return a copy of the map and of the place in it, to be written; see StoredMap.

        Keyframes are only stored with the name of a run of the graph, in which a node can go on with them.
        """
        with self._lock:
            belief, copies = self.estimator.belief, {one: self.estimator.map_of(one).begin_copy() for one in Layer}
            # After a step a run goes on only in this process, which knows it.
            keyframes = self.estimator.keyframes if run and not self.following.odometry.steps else {}
            correction = self.last_correction
        arrays = {} if belief is None else {**StoredPlace(correction, belief).arrays(), **keyframes}
        if self.origin is not None:
            arrays[STORED] = self.origin.array
        layers = {layer: finished(copy, self._lock) for layer, copy in copies.items()}
        return StoredMap(frame, layers, calibration, made, arrays, run)

    def restore(self, stored: StoredMap, same_odometry: bool) -> str:
        """Take a stored map in the place of the present one; return why its run cannot go on, else nothing.

        With the odometry under which it was stored the vehicle is expected where the stored correction puts it, and is
        searched everywhere too when three scans do not match there; otherwise it is searched everywhere from the start.
        Raises ValueError, and keeps the present map, for other resolutions than those of the parameters.
        """
        origin = stored.origin
        with self._lock:
            reason = self.estimator.restore(stored.layers, stored.arrays if same_odometry else {})
            self.changes += 1
            self.origin = origin
            self._forget_scans()
            self._search.lose()
            place = StoredPlace.of_arrays(stored.arrays) if same_odometry else None
            self.following.resumed_at = place
            if place is not None:
                self._expect(place.correction, place.widened)
        return reason

    def clear(self) -> int:
        """Forget map and place; return how many blocks the map had."""
        with self._lock:
            count = self.block_count
            self.changes += 1
            self.origin, self._began = None, np.inf
            self.estimator.clear()
            self._forget_scans()
            self._search.forget()
        return count

    def _forget_scans(self) -> None:
        self.following.clear()
        self._newest.clear()
