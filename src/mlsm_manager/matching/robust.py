"""Robust weights: how much a point counts that lies off what it is compared with."""

import numpy as np


def geman_mcclure(squared: np.ndarray, scale: float) -> np.ndarray:
    """Return weights (n,) of squared normalised residuals (n,): 1 at 0, 1/4 at `scale`, towards 0 beyond.

    Geman and McClure (1985), as used with Gauss-Newton: derivative of r^2 / (1 + r^2 / scale^2), over 2 r.
    """
    return (1.0 + squared / scale**2) ** -2
