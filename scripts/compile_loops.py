"""Compiles all loops of numba, so that no node has to: what is compiled stays in a cache on disk."""

import importlib
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

SOURCES = Path(__file__).resolve().parents[1] / "src"


def compile_loops_of(module: str) -> None:
    """Import a module, which compiles its loops, and compile those that wait for the first map."""
    found = importlib.import_module(module)
    if hasattr(found, "compile_loops"):
        found.compile_loops()


def main() -> None:
    """Compile what is not in the cache yet, on all processors: no module has another one's loops."""
    paths = [
        path for path in sorted(SOURCES.rglob("*.py")) if "from node_support.numba_cache import" in path.read_text()
    ]
    with ProcessPoolExecutor() as pool:
        list(pool.map(compile_loops_of, (".".join(path.relative_to(SOURCES).with_suffix("").parts) for path in paths)))


if __name__ == "__main__":
    main()
