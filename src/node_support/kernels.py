"""Loops that numba compiles, for who has it and asks for it; numpy does the same everywhere.

A node loads numba (0.3 s, 90 MB) only if one of its parameters is NUMBA, when it starts: loops have the types of their
arguments, so they are compiled, or read from numba's cache on disk, when their module is imported, never while beams
come in.
"""

from enum import Enum
from importlib.util import find_spec

from node_support.parameters import ParameterError


class Kernel(Enum):
    """What runs the loops of a stage."""

    NUMPY = "NUMPY"
    NUMBA = "NUMBA"


def check_kernel(key: str, kernel: Kernel) -> None:
    """Raise ParameterError, which says what to install, if the parameter `key` asks for numba where it is missing."""
    if kernel is Kernel.NUMBA and find_spec("numba") is None:
        raise ParameterError(f"{key} = NUMBA: needs numba; install it with: apt install python3-numba")
