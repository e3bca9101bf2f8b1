"""What keeps a map from being exported."""


class ExportError(ValueError):
    """The map cannot be written in that format; the text is one line and says what to do."""
