"""What is wrong with a file of a map."""


class MapFileError(ValueError):
    """A file is no map that can be read, or must not be written; the text is one line and names the path."""
