"""An echo model based on the sonar equation, the thesis's future work (4.1.2, 4.1.3, 6.4.1)."""

import math
from dataclasses import dataclass
from enum import Enum
from typing import Sequence

import numpy as np
from scipy.ndimage import uniform_filter1d

from node_support.parameters import ParameterSet, parameter
from sonar_simulator.echoes.beam_tracer import BeamPattern, Contacts
from sonar_simulator.echoes.ray_caster import Mirrors
from sonar_simulator.world.world import Material

SOUND_SPEED = 1500.0
"""m/s; a head converts times to ranges with a fixed speed."""
# Rays cover this many times the openings; outside, the beam is 15 dB down (two-way).
_CAST_WIDTH = 1.6
# m; nothing is nearer than the transducer's own face.
_NEAREST = 0.05
# dB; levels at or below this count as switched off.
_NONE = -100.0
_BEHIND = 1000.0  # dB: what lies behind the transducer is not heard
# Smallest cosine of the incidence angle: keeps its powers finite where facets reflect practically nothing.
_GRAZING = 0.05


class Detector(Enum):
    """What a head's strengths are proportional to."""

    AMPLITUDE = "amplitude"
    DECIBELS = "decibels"


@dataclass(frozen=True)
class PhysicalParameters(ParameterSet):
    """Parameters of `Physical`; levels are in dB above the receiver's noise in one bin, before gain."""

    bins: int = parameter(500, "bins of a beam", low=1, high=4096, thesis_name="binCount", tunable=False)
    max_range: float = parameter(50.0, "range of the last bin's far end", unit="m", low=0.1, high=1000.0)
    saturation: int = parameter(127, "greatest strength of a bin", low=1, high=255)
    vertical_opening_deg: float = parameter(
        22.0, "height of the beam, 3 dB down", unit="deg", low=0.1, high=90.0, thesis_name="opening"
    )
    horizontal_opening_deg: float = parameter(2.5, "width of the beam, 3 dB down", unit="deg", low=0.1, high=90.0)
    side_lobe_db: float = parameter(-100.0, "two-way level of the side lobes", unit="dB", low=-100.0, high=0.0)
    side_rays: int = parameter(60, "rays over all bearings for the side lobes, if there are any", low=0, high=10000)
    frequency_khz: float = parameter(
        675.0, "frequency of the sound, which determines the absorption", unit="kHz", low=10.0, high=3000.0
    )
    temperature: float = parameter(15.0, "temperature of the water", unit="C", low=-2.0, high=40.0)
    salinity: float = parameter(35.0, "salinity of the water; 0 in a tank", unit="per mille", low=0.0, high=42.0)
    pulse_length_us: float = parameter(100.0, "length of the pulse", unit="us", low=1.0, high=1000.0)
    source_level_db: float = parameter(
        105.0, "level of the echo from a surface 1 m away that fills the beam and reflects everything", unit="dB",
        low=0.0, high=250.0,
    )  # fmt: skip
    noise_level_db: float = parameter(0.0, "noise level of receiver and water", unit="dB", low=-300.0, high=100.0)
    volume_scattering_db: float = parameter(
        -60.0, "backscatter of a metre of water, as if it were a surface", unit="dB", low=-300.0, high=0.0
    )
    ringing: float = parameter(0.3, "range up to which the transducer still rings", unit="m", low=0.0, high=10.0)
    ringing_level_db: float = parameter(60.0, "level of the ringing at its start", unit="dB", low=0.0, high=200.0)
    speckle: float = parameter(1.0, "share of an echo that arrives with random phase", low=0.0, high=1.0)
    gain_db: float = parameter(20.0, "gain of the head", unit="dB", low=0.0, high=40.0, thesis_name="gain")
    tvg_spreading: float = parameter(
        20.0, "gain over range: times log10 of the range in m", unit="dB", low=0.0, high=40.0
    )
    tvg_absorption: float = parameter(
        0.2, "gain over range: compensated absorption, per metre each way", unit="dB/m", low=0.0, high=2.55,
        thesis_name="absorption / 100",
    )  # fmt: skip
    detector: Detector = parameter(Detector.DECIBELS, "what strengths are proportional to")
    full_level_db: float = parameter(
        110.0, "level at 1 m that gives the greatest strength at gain 0", unit="dB", low=-100.0, high=250.0
    )
    dynamic_range_db: float = parameter(
        40.0, "range from strength 0 to the greatest, for a detector in decibels", unit="dB", low=1.0, high=150.0
    )
    mirror_bounces: int = parameter(1, "reflections that are followed on the way out", low=0, high=5)
    surface_mirror: bool = parameter(False, "the water's surface, z = 0, is one of the mirrors")
    surface_loss_db: float = parameter(1.0, "loss at each reflection off the waves", unit="dB", low=0.0, high=60.0)
    vehicle_target_db: float = parameter(
        -100.0, "target strength of the vehicle itself, which reflects echoes once more", unit="dB", low=-100.0,
        high=20.0,
    )  # fmt: skip


class Physical:
    """Computes intensities by the sonar equation, adds speckle and noise as complex amplitudes, and returns strengths.

    A ray represents a cone of water of solid angle share x beam. Its patch of surface grows with the square of the
    range; the sound that arrives there and the sound that returns each fall with it. One square remains (spreading).
    A target smaller than the beam loses another square because fewer rays meet it the farther away it is.
    """

    def __init__(self, parameters: PhysicalParameters) -> None:
        self.parameters = parameters
        self.bins = parameters.bins
        self.max_range = parameters.max_range
        self.mirrors = Mirrors(
            parameters.mirror_bounces, parameters.surface_mirror, 1.0 - _ratio(-parameters.surface_loss_db)
        )
        self._resolution = parameters.max_range / parameters.bins
        self._absorption = absorption(parameters.frequency_khz, parameters.temperature, parameters.salinity)
        self._pulse = parameters.pulse_length_us * 1e-6 * SOUND_SPEED / 2.0
        self._kernel = _pulse_kernel(self._pulse / self._resolution)
        self._middles = (np.arange(parameters.bins) + 0.5) * self._resolution
        self._background = self._water() + self._ringing()
        self._receiver_gain = _ratio(self._tvg() + parameters.gain_db - parameters.full_level_db)

    def pattern(self, fan: BeamPattern) -> BeamPattern:
        """Return as many rays as `fan` has over the main lobe, which is wider than its openings at 3 dB."""
        openings = self.parameters.vertical_opening_deg, self.parameters.horizontal_opening_deg
        side_rays = self.parameters.side_rays if self.parameters.side_lobe_db > _NONE else 0
        return BeamPattern(*(math.radians(one * _CAST_WIDTH) for one in openings), fan.rows, fan.columns, side_rays)

    def echoes(self, contacts: Contacts, rng: np.random.Generator) -> np.ndarray:
        """Return strengths (beams, bins) uint8."""
        settings = self.parameters
        mean = self.intensities(contacts) + self._background
        random = mean * settings.speckle + _ratio(settings.noise_level_db)
        parts = rng.standard_normal((2, *mean.shape), dtype=np.float32)
        parts = self._as_long_as_the_pulse(parts) * np.sqrt(random / 2.0)
        parts[0] += np.sqrt(mean * (1.0 - settings.speckle))
        scaled = settings.saturation * self._detected(np.square(parts).sum(axis=0) * self._receiver_gain)
        return np.clip(np.rint(scaled), 0, settings.saturation).astype(np.uint8)

    def intensities(self, contacts: Contacts) -> np.ndarray:
        """Return the mean intensities (beams, bins) of the echoes alone, above the receiver's noise."""
        beams = len(contacts.ranges)
        index = np.ceil(np.minimum(contacts.ranges, 1e9) / self._resolution).astype(np.int64) - 1
        beam, contact = np.nonzero(index < self.bins)
        ranges = np.maximum(contacts.ranges[beam, contact], _NEAREST)
        patch = scattered(contacts.materials, contacts.material[beam, contact], contacts.cosines[beam, contact])
        patch *= contacts.shares[beam, contact] * contacts.losses[beam, contact]
        patch *= self._lobe(contacts.directions[beam, contact], ranges) / np.square(ranges)
        cells = beam * self.bins + np.maximum(index[beam, contact], 0)
        sums = np.bincount(cells, weights=patch, minlength=beams * self.bins).reshape(beams, self.bins)
        return self._with_second_echoes(self._spread_by_pulse(sums * _ratio(self.parameters.source_level_db)))

    def _with_second_echoes(self, first: np.ndarray) -> np.ndarray:
        """Add the echoes that the vehicle reflects again: they return after the sum of the ranges of two echoes."""
        if self.parameters.vehicle_target_db <= _NONE:
            return first
        spectrum = np.fft.rfft(first, 2 * self.bins, axis=1)
        second = np.fft.irfft(np.square(spectrum), 2 * self.bins, axis=1)[:, : self.bins]
        share = _ratio(self.parameters.vehicle_target_db - self.parameters.source_level_db)
        return first + share * np.maximum(second, 0.0)

    def _detected(self, power: np.ndarray) -> np.ndarray:
        """Return powers as shares of the greatest strength."""
        if self.parameters.detector is Detector.AMPLITUDE:
            return np.sqrt(power)
        return 1.0 + 10.0 * np.log10(np.maximum(power, 1e-30)) / self.parameters.dynamic_range_db

    def _lobe(self, directions: np.ndarray, ranges: np.ndarray) -> np.ndarray:
        """Return (n,) the share of each ray's intensity left after beam pattern (two-way) and absorption."""
        half_height = math.sin(math.radians(self.parameters.vertical_opening_deg) / 2.0)
        half_width = math.sin(math.radians(self.parameters.horizontal_opening_deg) / 2.0)
        across = 6.0 * np.square(directions[:, 1] / half_width) + _BEHIND * (directions[:, 0] < 0.0)
        across = np.minimum(across, -self.parameters.side_lobe_db)
        decibels = across + 6.0 * np.square(directions[:, 2] / half_height) + 2.0 * self._absorption * ranges
        return np.exp(decibels * (-math.log(10.0) / 10.0))

    def _spread_by_pulse(self, sums: np.ndarray) -> np.ndarray:
        spread = sums * self._kernel[0]
        for shift, share in enumerate(self._kernel[1:], 1):
            spread[:, shift:] += share * sums[:, :-shift]
        return spread

    def _as_long_as_the_pulse(self, parts: np.ndarray) -> np.ndarray:
        """Return unit random amplitudes that change only over the length of a pulse."""
        samples = round(self._pulse / self._resolution)
        if samples < 2:
            return parts
        return uniform_filter1d(parts, samples, axis=-1, mode="wrap") * math.sqrt(samples)

    def _water(self) -> np.ndarray:
        """Return the intensity (bins,) that the water itself returns."""
        settings = self.parameters
        level = settings.source_level_db + settings.volume_scattering_db + 10.0 * math.log10(self._pulse)
        ranges = np.maximum(self._middles, _NEAREST)
        return _ratio(level - 20.0 * np.log10(ranges) - 2.0 * self._absorption * ranges)

    def _ringing(self) -> np.ndarray:
        """Return the intensity (bins,) of the transducer's ringing, down to the noise at its end."""
        settings = self.parameters
        left = 1.0 - self._middles / max(settings.ringing, 1e-9)
        level = settings.noise_level_db + (settings.ringing_level_db - settings.noise_level_db) * left
        return np.where(left > 0.0, _ratio(level), 0.0)

    def _tvg(self) -> np.ndarray:
        ranges = np.maximum(self._middles, _NEAREST)
        settings = self.parameters
        return settings.tvg_spreading * np.log10(ranges) + 2.0 * settings.tvg_absorption * ranges


def scattered(materials: Sequence[Material], material: np.ndarray, cosines: np.ndarray) -> np.ndarray:
    """Return sigma / cos t: the share that a patch returns of 1 / cos t times its ray's cross-section, at incidence t.

    material: (...) int, number of each ray's material. cosines: (...) of t.

    Facets of a surface with Gaussian slopes reflect sound back where they face the sonar (Kirchhoff's approximation
    for high frequencies); finer roughness scatters it by Lambert's law (APL-UW TR 9407, section IV):
    sigma = R^2 / (8 pi s^2 cos^4 t) exp(-tan^2 t / 2 s^2) + mu cos^2 t.
    """
    square_slopes = np.array([one.slope**2 for one in materials])
    facets = np.array([one.reflection**2 for one in materials]) / (8.0 * math.pi * square_slopes)
    lambert = np.array([10.0 ** (one.lambert_db / 10.0) for one in materials])
    cosines = np.maximum(cosines, _GRAZING)
    inverse_square = 1.0 / np.square(cosines)
    facing = facets[material] * np.exp((0.5 / square_slopes)[material] * (1.0 - inverse_square))
    return facing * np.square(inverse_square) / cosines + lambert[material] * cosines


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


def _ratio(decibels: np.ndarray) -> np.ndarray:
    return 10.0 ** (decibels / 10.0)


def _pulse_kernel(length: float) -> np.ndarray:
    """Return how an echo that begins anywhere in a bin spreads over this and later bins; pulse of `length` bins."""
    beginnings, within = np.meshgrid((np.arange(64) + 0.5) / 64.0, (np.arange(256) + 0.5) / 256.0 * length)
    counts = np.bincount((beginnings + within).astype(np.int64).ravel())
    return counts / counts.sum()
