"""What goes wrong when a world is loaded."""


class WorldError(ValueError):
    """No world can be made of a file; the text names the file."""
