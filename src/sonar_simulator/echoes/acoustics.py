"""High-frequency sound in water: absorption, and scattering by rough surfaces."""

import math
from typing import Sequence

import numpy as np

from sonar_simulator.world.materials import Material

SOUND_SPEED = 1500.0
"""m/s; a head converts times to ranges with a fixed speed."""
# Smallest cosine of the incidence angle: keeps its powers finite where facets reflect practically nothing.
_GRAZING = 0.05


def absorption(frequency_khz: float, temperature: float, salinity: float) -> float:
    """Return the absorption of sea water near the surface, dB/m (Ainslie and McColm, JASA 103, 1998; pH 8).

    temperature: degrees Celsius. salinity: parts per thousand, 0 in fresh water. Thesis 4.1.3 names its two causes:
    ionic relaxation (of boric acid and magnesium sulphate) and viscous friction.
    """
    square = frequency_khz**2
    boron = 0.78 * math.sqrt(salinity / 35.0) * math.exp(temperature / 26.0)
    magnesium = 42.0 * math.exp(temperature / 17.0)
    by_boron = 0.106 * boron * square / (boron**2 + square) if salinity > 0.0 else 0.0
    by_magnesium = 0.52 * (1 + temperature / 43.0) * salinity / 35.0 * magnesium * square / (magnesium**2 + square)
    by_friction = 0.00049 * square * math.exp(-temperature / 27.0)
    return (by_boron + by_magnesium + by_friction) / 1000.0


class Scattering:
    """How much sound a ray's patch of surface returns, by material and incidence.

    Facets of a surface with Gaussian slopes reflect sound back where they face the sonar (Kirchhoff's approximation
    for high frequencies); finer roughness scatters it by Lambert's law (APL-UW TR 9407, section IV):
    sigma = R^2 / (8 pi s^2 cos^4 t) exp(-tan^2 t / 2 s^2) + mu cos^2 t, at incidence t.
    """

    def __init__(self, materials: Sequence[Material]) -> None:
        square_slopes = np.array([material.slope**2 for material in materials])
        reflections = np.array([material.reflection**2 for material in materials])
        self._facets = reflections / (8.0 * math.pi * square_slopes)
        self._steepness = 0.5 / square_slopes
        self._lambert = np.array([10.0 ** (material.lambert_db / 10.0) for material in materials])

    def per_ray(self, material: np.ndarray, cosines: np.ndarray) -> np.ndarray:
        """Return sigma / cos t: the share that returns from a patch of 1 / cos t times the ray's cross-section.

        material: (...) int, number of each ray's material. cosines: (...) of the incidence t.
        """
        cosines = np.maximum(cosines, _GRAZING)
        inverse_square = 1.0 / np.square(cosines)
        facets = self._facets[material] * np.exp(self._steepness[material] * (1.0 - inverse_square))
        return facets * np.square(inverse_square) / cosines + self._lambert[material] * cosines
