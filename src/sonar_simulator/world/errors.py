"""Errors of loading a world."""

import sys


class WorldError(ValueError):
    """A file cannot be loaded as a world; the text names the file."""


class MissingPackageError(WorldError):
    """A Python package that the simulator needs is not installed; the text says how to install it."""

    def __init__(self, purpose: str, package: str, reason: ImportError) -> None:
        """`purpose` says what the package does here; `package` is its name at PyPI."""
        super().__init__(f"{reason}: it {purpose}; install it: {sys.executable} -m pip install {package}")
