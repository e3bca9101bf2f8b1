"""Planar and spatial poses as arrays."""
