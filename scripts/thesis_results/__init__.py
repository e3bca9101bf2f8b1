"""Computes docs/results.md: the thesis's chapter 7 with this package, and what the thesis could not show."""
