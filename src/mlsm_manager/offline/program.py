"""map_bag as a program."""

import os
import sys


def main() -> None:
    """Run map_bag with the command line."""
    # The matrices are small: with more threads they would only wait for each other. numpy reads this when it is loaded.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    try:
        from mlsm_manager.offline.map_bag import run_map_bag
    except KeyboardInterrupt:
        sys.exit("map_bag: interrupted")
    run_map_bag()
