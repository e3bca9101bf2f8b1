"""Where numba keeps what it compiles: it refuses to work where it finds no folder to write to."""

import atexit
import logging
import shutil
import tempfile
from functools import lru_cache
from typing import Any, Callable

ADVICE = "set NUMBA_CACHE_DIR to a folder that can be written to"


@lru_cache(maxsize=None)
def has_cache() -> bool:
    """Return whether numba finds a folder that lasts; the first time that there is none, one line says what to do."""
    from numba import njit

    try:
        njit(cache=True)(_probe)
    except RuntimeError:
        logging.getLogger(__name__).warning(
            "numba finds no folder to keep compiled loops in and compiles them at every start: %s", ADVICE
        )
        return False
    return True


@lru_cache(maxsize=None)
def prepare_cache() -> None:
    """Let numba compile into a temporary folder of this process where it finds none that lasts.

    Raises ImportError where no temporary folder can be made.
    """
    if has_cache():
        return
    from numba import config

    try:
        config.CACHE_DIR = tempfile.mkdtemp(prefix="compiled_loops_")
    except OSError as error:
        raise ImportError(f"no temporary folder for compiled loops: {error}; {ADVICE}") from None
    atexit.register(shutil.rmtree, config.CACHE_DIR, ignore_errors=True)


def compiled(*signature: Any, **options: Any) -> Callable[[Callable[..., Any]], Any]:
    """Return numba's decorator for a loop that stays compiled in the cache on disk, see `prepare_cache`.

    signature, options: as numba.njit takes them; with a signature the loop is compiled where it is defined, otherwise
    when it is called first with arguments of new types.
    """
    prepare_cache()
    from numba import njit

    return njit(*signature, cache=True, **options)


def _probe() -> None:
    """Stand for any function of this package."""
