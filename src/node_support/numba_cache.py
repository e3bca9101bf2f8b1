"""Compiles loops with numba and keeps them on disk: numba refuses to work where it finds no folder to write to."""

import atexit
import logging
import shutil
import tempfile
from functools import lru_cache
from typing import Any, Callable

from numba import config, njit

# Bytes by which numba may tell the types of a tuple: two and eight for each array; of a named tuple the names, too.
# Numba 0.56 forgets the beginning of a longer one, takes it for new with nearly each call, and keeps it for ever.
LONGEST_DESCRIPTION = 40
_ADVICE = "set NUMBA_CACHE_DIR to a folder that can be written to"


def compiled(*signature: Any, **options: Any) -> Callable[[Callable[..., Any]], Any]:
    """Return numba's decorator for a loop that stays compiled in the cache on disk.

    signature, options: as numba.njit takes them. With a signature the loop is compiled, or read from the cache, when
    its module is imported, otherwise when it is called first with arguments of new types. Arrays of messages are
    read-only. Tuples as arguments must be short, see LONGEST_DESCRIPTION. Raises ImportError where numba finds no
    folder, not even a temporary one.
    """
    _prepare_cache()

    def decorated(loop: Callable[..., Any]) -> Any:
        _discard_unreadable(loop)
        return njit(*signature, cache=True, **options)(loop)

    return decorated


def _discard_unreadable(loop: Callable[..., Any]) -> None:
    """Empty a loop's cache that was written by another version of this package with classes that are gone.

    Numba reads the classes before it looks whether the loop's file has changed, and fails on those that are gone.
    """
    cache_file = getattr(getattr(njit(cache=True)(loop), "_cache", None), "_cache_file", None)
    if cache_file is None:
        return
    try:
        cache_file._load_index()
    except (AttributeError, ImportError):
        cache_file.flush()


@lru_cache(maxsize=None)
def _prepare_cache() -> None:
    """Let numba compile into a temporary folder of this process where it finds none that lasts; one line says so."""
    try:
        njit(cache=True)(_probe)
        return
    except RuntimeError:
        logging.getLogger(__name__).warning(
            "numba finds no folder to keep compiled loops in: they are compiled at every start; %s", _ADVICE
        )
    try:
        config.CACHE_DIR = tempfile.mkdtemp(prefix="compiled_loops_")
    except OSError as error:
        raise ImportError(f"no temporary folder for compiled loops: {error}; {_ADVICE}") from None
    atexit.register(shutil.rmtree, config.CACHE_DIR, ignore_errors=True)


def _probe() -> None:
    """Stand for any function of this package."""
