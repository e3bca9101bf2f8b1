"""The dead_reckoning node."""
