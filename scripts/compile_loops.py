"""Compiles all loops of numba, so that no node has to: what is compiled stays in a cache on disk."""

import importlib
from pathlib import Path

from mlsm_manager.surface_map.mlsm import MultiLevelSurfaceMap

SOURCES = Path(__file__).resolve().parents[1] / "src"


def main() -> None:
    """Compile what is not in the cache yet: most loops when their module is imported, the map's with the first map."""
    for path in sorted(SOURCES.rglob("*.py")):
        if "from node_support.numba_cache import" in path.read_text():
            importlib.import_module(".".join(path.relative_to(SOURCES).with_suffix("").parts))
    MultiLevelSurfaceMap(1.0)


if __name__ == "__main__":
    main()
