"""Errors of loading a world."""


class WorldError(ValueError):
    """A file cannot be loaded as a world; the text names the file."""
