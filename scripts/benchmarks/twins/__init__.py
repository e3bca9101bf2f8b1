"""Twins of a real run: its path and timing in simulated water, with everything else varied and the truth known."""
