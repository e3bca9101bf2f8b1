"""What became of a scan or a cloud that a mapper took."""

from dataclasses import dataclass
from typing import List, Optional

from mlsm_manager.scan_matching.prediction import Belief
from mlsm_manager.scan_matching.result import MatchResult
from mlsm_manager.scan_matching.scan import Scan
from mlsm_manager.surface_map.admission import InsertReport
from mlsm_manager.surface_map.free_space.carving import CarveReport

MOST_WAITING = 8
"""Clouds that wait for their scans: with one per scan, more than a matcher is ever behind."""
NOTHING_INSERTED = InsertReport(0, 0, 0)


@dataclass(frozen=True)
class ScanUpdate:
    """What was done with a scan.

    result: None when it was not matched. accepted: whether it was put into the map. belief: after the scan.
    found: how the vehicle was found again with it after a silence of the sonar; empty where it was not.
    forgotten: turns of the head that lay apart from the map and are left out of it, because the run began anew.
    provisional: whether the map hangs on scans of an unknown velocity, none of which agrees with another yet.
    """

    scan: Scan
    result: Optional[MatchResult]
    accepted: bool
    belief: Belief
    found: str = ""
    provisional: bool = False
    forgotten: int = 0


@dataclass(frozen=True)
class CloudUpdate:
    """What was done with a cloud.

    report: of the insertion. waiting: whether it waits for the match of its time. unplaced: number of points that were
    not inserted because the scan of their time was rejected.
    carved: what its beams said about free space, None where nobody asked or the vehicle's position is not known.
    """

    report: InsertReport
    waiting: bool
    unplaced: int
    carved: Optional[CarveReport] = None


@dataclass(frozen=True)
class Taken:
    """What was done with a scan, and with the clouds that could be inserted after it."""

    scan: ScanUpdate
    clouds: List[CloudUpdate]
