"""Polar images with echoes, rings and speckle of known place."""

import numpy as np


def wall_image(ranges, bins=400, sigma=2.0, height=100.0):
    """Return (beams, bins) float32 with one Gaussian echo per beam, centred on the fractional bins `ranges`."""
    bin_numbers = np.arange(bins)
    return (height * np.exp(-0.5 * ((bin_numbers - np.asarray(ranges)[:, np.newaxis]) / sigma) ** 2)).astype(np.float32)


def with_ring(image, at, width=30, strength=60.0):
    """Return the image with a ring of the same strength in every direction."""
    ringed = image.copy()
    ringed[:, at : at + width] += strength
    return ringed


def with_speckle(image, seed, strength=30.0):
    """Return the image with Rayleigh noise."""
    return image + np.random.default_rng(seed).rayleigh(strength / 3.0, image.shape).astype(np.float32)


def binary_image(starts, lengths, bins=400):
    """Return (beams, bins) uint8 of strengths 0 and 127: one run per beam."""
    bin_numbers = np.arange(bins)
    starts, lengths = np.asarray(starts)[:, np.newaxis], np.asarray(lengths)[:, np.newaxis]
    return np.where((bin_numbers >= starts) & (bin_numbers < starts + lengths), 127, 0).astype(np.uint8)
