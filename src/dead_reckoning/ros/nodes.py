"""The executables of this package."""

from dead_reckoning.ros.dead_reckoning import DeadReckoning
from node_support.ros.node import run


def run_dead_reckoning() -> None:
    """Run dead_reckoning."""
    run("dead_reckoning", DeadReckoning)
