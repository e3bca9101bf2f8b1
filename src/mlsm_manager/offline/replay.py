"""Runs the mapper over a recording as the live graph would have run it."""

from dataclasses import dataclass, field
from typing import Callable, List, Sequence

import numpy as np

from mlsm_manager.localisation.live_correction import LiveCorrection
from mlsm_manager.localisation.mapper import Mapper, ScanUpdate
from mlsm_manager.localisation.sensor_model import trusted
from mlsm_manager.matching.problem.scan import Scan
from mlsm_manager.offline.recording import Recording
from mlsm_manager.offline.replay_parameters import ReplayParameters
from node_support.geometry.planar import composed


@dataclass(frozen=True)
class Replayed:
    """What came of a replay.

    times: (m,) s of the odometry. odometry, corrected: (m, 3) T_odom_base and T_map_base, the second as it was known
    at each moment. updates: of all scans, oldest first.
    """

    times: np.ndarray
    odometry: np.ndarray
    corrected: np.ndarray
    mapper: Mapper
    updates: List[ScanUpdate] = field(default_factory=list)

    @property
    def matched(self) -> int:
        """Scans whose match was accepted."""
        return sum(update.accepted and update.result is not None for update in self.updates)

    @property
    def rejected(self) -> int:
        """Scans whose match was not accepted."""
        return sum(not update.accepted for update in self.updates)


def replay(
    recording: Recording, scans: Sequence[Scan], parameters: ReplayParameters, on_scans: Callable[[int], None]
) -> Replayed:
    """Match the `scans` of corrected beams one after the other; `on_scans` is told with 1 that one is done.

    A scan is used from the moment on at which its last beam and the odometry of that time were known.
    """
    mapper, live = parameters.build_mapper(), LiveCorrection(parameters.blend_time)
    track, corrections, updates = recording.track, np.empty((len(recording.track.times), 3)), []
    done = 0
    for untrusted in scans:
        scan = trusted(untrusted, parameters.edge_half_width)
        known = int(np.searchsorted(track.times, scan.reference_time, side="left"))
        done = _follow(live, recording, corrections, done, known)
        updates.append(mapper.take_echoes(scan))
        mapper.take_cloud(scan)
        while mapper.take_waiting() is not None:
            pass
        live.believe(updates[-1].belief)
        on_scans(1)
    _follow(live, recording, corrections, done, len(track.times))
    corrected = composed(corrections, track.poses)
    return Replayed(track.times, track.poses, corrected, mapper, updates)


def _follow(live: LiveCorrection, recording: Recording, corrections: np.ndarray, start: int, end: int) -> int:
    track = recording.track
    for index in range(start, end):
        corrections[index] = live.sample(float(track.times[index]), track.poses[index])
    return max(start, end)
