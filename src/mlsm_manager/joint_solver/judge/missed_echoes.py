"""How much speaks against a path: echoes that stand alone, as of posts, that other turns should have heard too."""

import numpy as np
from scipy.spatial import cKDTree

from mlsm_manager.joint_solver.ways.way_echoes import WayEchoes

_SAME = 3.0  # m: an echo so near a place was heard of what stands there, or of what stands beside it
_NEAREST = 4.0  # m from the vehicle: nearer, the beam may pass above
_WIDTH, _BREADTH = 0.05, 0.5  # rad, m: a surface hides what lies so near to the line of sight behind it


class MissedEchoes:
    """Tells of a path how much its echoes are missed.

    What stands alone and was heard from far away is heard from nearer too, unless something stands before it. Where a
    path is wrong the vehicle seems to have passed posts without hearing them.
    """

    def __init__(self, echoes: WayEchoes, parts: int) -> None:
        """echoes: of all scans, the nodes of which count from 0. parts: scans per turn of the head."""
        self._echoes, self._parts = echoes, parts
        self._lone = np.flatnonzero(echoes.lone & (echoes.nats > 0.0))
        self._turns = echoes.nodes // parts
        ranges = np.hypot(*echoes.arms.T)
        self._ranges, self._sights = ranges, echoes.arms / np.maximum(ranges, 1e-9)[:, np.newaxis]

    def nats(self, path: np.ndarray) -> float:
        """Return how much [nats] they speak against a path (k, 2) [m] in map through all nodes.

        Each echo counts as far as the turns that should have heard it, and its own one, did not.
        """
        lone, missed, heard = self._lone, np.zeros(len(self._lone)), np.zeros(len(self._lone))
        if not len(lone):
            return 0.0
        places = self._echoes.places(path, 0)
        origins = places - self._echoes.arms
        for turn in np.unique(self._turns):
            others = self._turns[lone] != turn
            own = np.flatnonzero(self._turns == turn)
            distance, _ = cKDTree(places[own]).query(places[lone], distance_upper_bound=_SAME)
            heard += others & np.isfinite(distance)
            nodes = path[self._parts * turn : self._parts * (turn + 1) + 1]
            silent = np.flatnonzero(others & ~np.isfinite(distance) & self._in_reach(places[lone], nodes))
            missed[silent] += ~self._hidden(places[lone[silent]], origins[own], own)
        return float(self._echoes.nats[lone] @ (missed / (1.0 + missed + heard)))

    def _in_reach(self, places: np.ndarray, nodes: np.ndarray) -> np.ndarray:
        """Return which lone echoes (n,) at `places` (n, 2) stayed nearer to `nodes` (m, 2) than when heard."""
        distance = np.hypot(*(places[:, np.newaxis] - nodes).transpose(2, 0, 1))
        return (distance.max(axis=1) < self._ranges[self._lone]) & (distance.min(axis=1) > _NEAREST)

    def _hidden(self, places: np.ndarray, origins: np.ndarray, own: np.ndarray) -> np.ndarray:
        """Return which `places` (n, 2) lie behind an echo `own` (m,) that was heard from `origins` (m, 2)."""
        offset = places[:, np.newaxis] - origins
        along = np.einsum("nma,ma->nm", offset, self._sights[own])
        beside = np.abs(offset[..., 0] * self._sights[own, 1] - offset[..., 1] * self._sights[own, 0])
        on_line = (along > 0.0) & (beside < _WIDTH * along + _BREADTH)
        return (on_line & (self._ranges[own] < along - _SAME)).any(axis=1)
