"""The exception with which a core refuses data that it cannot use, numbers in such texts, and missing libraries."""

from importlib import import_module
from typing import Any, Callable


class RefusedInput(ValueError):  # noqa: N818 - named for what it says, it is not an error of the program
    """Input that cannot be used. `kind` names the counter in /diagnostics; the text holds the offending value."""

    def __init__(self, kind: str, detail: str) -> None:
        super().__init__(detail)
        self.kind = kind


def needed(module: str, install: str, failure: Callable[[str], Exception]) -> Any:
    """Return a module of a library that not everybody needs; raises `failure` of how to `install` it."""
    try:
        return import_module(module)
    except ImportError:
        raise failure(f"needs {module.partition('.')[0]}; install it with: {install}") from None


def counted(number: int, noun: str) -> str:
    """Return a number of things whose plural ends with s."""
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"
