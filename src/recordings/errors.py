"""The error with which a recording is refused."""


class RecordingError(ValueError):
    """A recording cannot be used; the text is one line that says which, why and what to do."""
