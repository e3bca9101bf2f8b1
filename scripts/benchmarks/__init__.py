"""Figures of the package, each measured by a command of the repository: scripts/bench."""
