"""Robust weights: how much a point counts that lies off what it is compared with (Geman and McClure 1985)."""

import numpy as np


def geman_mcclure(squared: np.ndarray, scale: float) -> np.ndarray:
    """Return Gauss-Newton weights (n,) of squared normalised residuals (n,): 1 at 0, 1/4 at `scale`, towards 0."""
    return (1.0 + squared / scale**2) ** -2


def geman_mcclure_cost(squared: np.ndarray, scale: float) -> np.ndarray:
    """Return costs (n,) whose slope the weights are: half the square near 0, never above half of `scale` squared."""
    return 0.5 * squared / (1.0 + squared / scale**2)
