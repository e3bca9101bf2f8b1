"""Mapping of recordings: replay, calibration, refinement and the files that are left."""
