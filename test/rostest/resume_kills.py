#!/usr/bin/env python3
"""A node that matches with the joint solver keeps its map and its place over kills with -9 at random moments."""

import sys
import unittest
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from itertools import chain
from pathlib import Path
from typing import List

import numpy as np
import rospy
from graph import PACKAGE_ROOT, run, temporary_folder
from resumed_vehicle import Fate, Kill, Mission, ResumedVehicle

sys.path += [str(PACKAGE_ROOT / "test/unit"), str(PACKAGE_ROOT / "test/unit/mlsm_manager")]

from made_harbour import SONAR_IN_BASE, tour

KILLS_PER_MISSION = 5
SCANS = 24
VEHICLES = 4
"""Vehicles at the same time."""
KNOWN = 0.5
"""m, to which a path is known that is the truth."""
KEPT = 0.9
"""Share of the saved cells; scans that may still move are drawn anew, and floats of 32 bits fall into other cells."""


class ResumeKills(unittest.TestCase):
    """Vehicles are killed `~kills` times altogether, each in a harbour of its own."""

    def test_no_kill_loses_the_map_or_puts_the_vehicle_elsewhere(self) -> None:
        folder = temporary_folder(self)
        numbers = range(rospy.get_param("~kills") // KILLS_PER_MISSION)
        with ThreadPoolExecutor(VEHICLES) as pool:
            kills = list(chain.from_iterable(pool.map(lambda number: self._kills(folder, number), numbers)))
        tell(kills)
        self.assertEqual([kill for kill in kills if kill.map_kept < KEPT or kill.fate is Fate.WRONG], [])
        self.assertGreater(sum(kill.fate is Fate.GOES_ON for kill in kills), len(kills) // 2)

    def _kills(self, folder: Path, number: int) -> List[Kill]:
        return ResumedVehicle(f"/vehicle_{number}", folder, made_mission(number)).die_often(KILLS_PER_MISSION)


def tell(kills: List[Kill]) -> None:
    """Print what became of the kills."""
    fates = ", ".join(f"{fate.value} {count}" for fate, count in Counter(kill.fate for kill in kills).items())
    lost = [kill.seconds_lost for kill in kills]
    print(f"{len(kills)} kills: {fates}")
    print(f"share of the saved map that is there after a kill: least {min(kill.map_kept for kill in kills):.3f}")
    print(f"from the first fix that was not saved to the kill, s: median {np.median(lost):.2f}, most {max(lost):.2f}")
    farthest = [round(kill.distance, 2) for kill in kills], [round(kill.deviation, 2) for kill in kills]
    print(f"farthest fix after each, m: {farthest[0]}\nwhat it says of itself, m: {farthest[1]}", flush=True)


def made_mission(seed: int) -> Mission:
    """Return a tour of a harbour with the truth, in the frame that a map which begins in odom has."""
    made = tour(SCANS, direction=0.05, seed=seed)
    return Mission(made.scans, made.odometry, made.truth, KNOWN, {"free_scans": 8}, SONAR_IN_BASE)


if __name__ == "__main__":
    run(ResumeKills)
