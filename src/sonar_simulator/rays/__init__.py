"""Rays, the surfaces that they hit, and mirrors."""
