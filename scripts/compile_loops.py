"""Compiles all loops of numba, so that no node has to: what is compiled stays in a cache on disk."""

import importlib
import re
from pathlib import Path

from mlsm_manager.surface_map.mlsm import MultiLevelSurfaceMap
from node_support.numba_cache import prepare_cache

SOURCES = Path(__file__).resolve().parents[1] / "src"


def main() -> None:
    """Compile what is not in the cache yet: most loops when their module is imported, the map's with the first map."""
    prepare_cache()
    for path in sorted(SOURCES.rglob("*.py")):
        if re.search("^from (numba|node_support.numba_cache) import", path.read_text(), re.MULTILINE):
            importlib.import_module(".".join(path.relative_to(SOURCES).with_suffix("").parts))
    MultiLevelSurfaceMap(1.0)


if __name__ == "__main__":
    main()
