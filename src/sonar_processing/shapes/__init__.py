"""Walls and round things in a scan."""
