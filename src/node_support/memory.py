"""Memory that a process holds but does not use."""

import ctypes

# Of mallopt in glibc's malloc.h.
_MMAP_THRESHOLD, _ARENA_MAX = -3, -8
_LARGE = 2**17  # bytes: as glibc begins with, but it raises that to the largest array that was ever freed
_ARENAS = 2


def hold_little() -> None:
    """Give large arrays memory of their own, which goes back when they do, and let threads share what is left.

    A node makes arrays of all sizes for hours and keeps a few. glibc would hold several times what it uses: a heap for
    each thread, with holes where large arrays were.
    """
    set_option = getattr(ctypes.CDLL(None), "mallopt", None)
    if set_option is not None:
        set_option(_MMAP_THRESHOLD, _LARGE)
        set_option(_ARENA_MAX, _ARENAS)


def give_back() -> None:
    """Give what was freed back to the system, also between what is still used."""
    trim = getattr(ctypes.CDLL(None), "malloc_trim", None)
    if trim is not None:
        trim(0)
