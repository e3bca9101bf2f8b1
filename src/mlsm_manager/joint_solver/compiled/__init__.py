"""Loops compiled by numba. Nothing here imports the rest of the solver."""
