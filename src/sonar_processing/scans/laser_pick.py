"""The bin of a beam that a laser would have seen (thesis 6.5.2, mode LASER)."""

from typing import Tuple

import numpy as np

from sonar_processing.scans.parameters import LaserPick, SonarToCloudParameters


def picked_bins(
    strengths: np.ndarray, keep: np.ndarray, parameters: SonarToCloudParameters
) -> Tuple[np.ndarray, np.ndarray]:
    """Return the bin (beams,) of each beam, and (beams,) bool whether it holds an echo.

    strengths: (beams, bins); keep: (beams, bins) bool, the bins that may be taken. STRONGEST takes the nearest of
    equally strong ones.
    """
    heard = np.where(keep, strengths, -1.0)
    if parameters.laser_pick is LaserPick.FIRST:
        bins = np.argmax(heard > parameters.laser_first_above, axis=1)
        least = parameters.laser_first_above
    else:
        bins = np.argmax(heard, axis=1)
        least = parameters.laser_strongest_above
    return bins, heard[np.arange(len(heard)), bins] > least
