"""Maps brought into another frame."""

from dataclasses import dataclass

import numpy as np

from mlsm_manager.surface_map.blocks import BOTTOM, MEAN, SQUARES, TOP, Blocks

_WHOLE_TURNS = 1e-12
"""rad; a quarter turn that differs from pi / 2 by no more is one, so that its sine and cosine are exactly 0 and 1."""


@dataclass(frozen=True)
class LevelTransform:
    """T_a_b between two level frames: x y z [m] of b in a, and yaw [rad] counter-clockwise about +z."""

    x: float = 0.0
    y: float = 0.0
    z: float = 0.0
    yaw: float = 0.0

    def keeps_cells(self, resolution: float) -> bool:
        """Return whether it takes cells to cells: a whole number of cells along x and y, and of quarter turns."""
        cells = np.array([self.x, self.y]) / resolution
        return bool(np.abs(cells - np.rint(cells)).max() < 1e-9 and self._is_quarter())

    def rotation(self) -> np.ndarray:
        """Return the (2, 2) rotation in the plane."""
        cos, sin = np.cos(self.yaw), np.sin(self.yaw)
        rotation = np.array([[cos, -sin], [sin, cos]])
        return np.rint(rotation) if self._is_quarter() else rotation

    def _is_quarter(self) -> bool:
        quarters = self.yaw / (np.pi / 2.0)
        return bool(abs(quarters - np.rint(quarters)) * np.pi / 2.0 < _WHOLE_TURNS)


def moved(blocks: Blocks, T_new_old: LevelTransform) -> Blocks:
    """Return the blocks in the new frame, one for each.

    All is exact, but where the yaw is no number of quarter turns only the sum of the variances of x and y is: blocks do
    not know how x and y vary together, and are taken as if they did not.
    """
    rows, rotation = blocks.rows.copy(), T_new_old.rotation()
    rows[:, :2] = rows[:, :2] @ rotation.T + (T_new_old.x, T_new_old.y)
    rows[:, [MEAN.start + 2, BOTTOM, TOP]] += T_new_old.z
    plane = slice(SQUARES.start, SQUARES.start + 2)
    rows[:, plane] = rows[:, plane] @ (rotation**2).T
    return Blocks(rows, blocks.resolution, blocks.crossed)
