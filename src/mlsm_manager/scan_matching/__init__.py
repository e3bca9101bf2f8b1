"""Finds where a single scan lies in a map: to start, after the vehicle was lost, and to resume."""
