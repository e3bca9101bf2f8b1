"""Compiles all loops of numba, so that no node has to: what is compiled stays in a cache on disk."""

import importlib
from pathlib import Path

from node_support.numba_cache import prepare_cache

SOURCES = Path(__file__).resolve().parents[1] / "src"


def main() -> None:
    """Compile what is not in the cache yet: a loop is compiled when its module is imported."""
    prepare_cache()
    for path in sorted(SOURCES.rglob("*.py")):
        if "from numba import" in path.read_text() and path.parent.name != "node_support":
            importlib.import_module(".".join(path.relative_to(SOURCES).with_suffix("").parts))


if __name__ == "__main__":
    main()
