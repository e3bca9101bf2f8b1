"""How sharp the benchmark of logs calls a map: walls that lie on each other, and walls that do not."""

import numpy as np
import pytest
from benchmarks.logs import blocks_per_metre, blur

SIDE, WALL = 0.5, 0.1  # m: of a block, and y of a wall along x


def sweeps(echoes, aside):
    """Return ten sweeps (echoes, 2) of 60 m of wall, every other one `aside` [m] beside those between."""
    generator = np.random.default_rng(3)
    beside = WALL + aside * (np.arange(10) % 2)
    return [np.column_stack([generator.uniform(0.0, 60.0, echoes), np.full(echoes, y)]) for y in beside]


def test_more_sweeps_of_the_same_wall_fill_more_blocks_and_are_no_blur():
    heard = sweeps(20, aside=0.0)
    together = np.concatenate(heard)
    assert blocks_per_metre(together, SIDE) > 1.3 * blocks_per_metre(heard[0], SIDE)
    assert blur(together, heard[0], SIDE) == pytest.approx(1.0, abs=0.1)


def test_sweeps_that_lie_beside_each_other_are_blur():
    heard = sweeps(200, aside=SIDE)
    assert blur(np.concatenate(heard), heard[0], SIDE) > 1.2


def test_a_sweep_without_echoes_has_no_blur():
    assert np.isnan(blur(np.empty((0, 2)), np.empty((0, 2)), SIDE))
