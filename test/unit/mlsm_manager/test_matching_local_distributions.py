"""What the local distributions of a map hold of a wall, of its end and of a buoy."""

import numpy as np
from made_scans import map_of, wall

from mlsm_manager.scan_matching.distributions import LocalDistributions


def directions(distributions):
    """Return for each block the angle [rad] of its longer axis from x, between -pi/2 and pi/2."""
    _, vectors = np.linalg.eigh(distributions.covariance)
    return np.arctan(vectors[:, 1, 1] / vectors[:, 0, 1])


def test_a_wall_of_few_noisy_echoes_keeps_its_direction():
    """Three neighbours, a metre apart and scattered by 0.4 m, often lie across the wall."""
    wrong = []
    for seed in range(5):
        echoes = wall((-30, 25), (30, 25), spacing=1.0)
        echoes = echoes + np.random.default_rng(seed).normal(0.0, 0.4, echoes.shape)
        wrong.append(np.quantile(np.abs(directions(LocalDistributions(map_of(echoes)))), 0.9))
    assert np.mean(wrong) < 0.1


def test_points_slide_along_a_wall_up_to_its_mapped_end():
    distributions = LocalDistributions(map_of(wall((-10, 5), (10, 5))))
    assert (distributions.covariance[:, 0, 0] > 5.0**2).all()
    assert (distributions.covariance[:, 1, 1] < 0.3**2).all()


def test_a_buoy_holds_a_point_on_all_sides():
    around = 0.2 * np.column_stack([np.cos(np.arange(6.0)), np.sin(np.arange(6.0))])
    distributions = LocalDistributions(map_of(np.array([8.0, 3.0]) + around))
    assert (np.linalg.eigvalsh(distributions.covariance)[:, 1] < 1.0).all()
