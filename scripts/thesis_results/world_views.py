"""Draws worlds from above."""

from typing import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection

from sonar_simulator.world.world import World
from sonar_simulator.world.world_mesh import world_triangles


def draw_world(axes: Axes, world: World, place: Sequence[float]) -> None:
    """Draw a world's triangles, the highest last, around `place` x y z [m]."""
    triangles = world_triangles(world)
    corners = triangles.points.reshape(-1, 3, 3) - np.array(place)
    order = np.argsort(corners[..., 2].mean(axis=1))
    axes.add_collection(
        PolyCollection(
            corners[order, :, :2], facecolors=triangles.colours[::3][order], linewidths=0, antialiaseds=False
        )
    )


def draw_outlines(axes: Axes, world: World, label: str) -> None:
    """Draw the outlines of what stands upright."""
    lines = [np.asarray(outline)[:, :2] for outline in world.outlines()]
    axes.add_collection(LineCollection(lines, colors="#1f5fa8", linewidths=1.0, zorder=1, label=label))
