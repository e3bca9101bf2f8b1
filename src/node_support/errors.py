"""The exception with which a core refuses data that it cannot use."""


class RefusedInput(ValueError):  # noqa: N818 - named for what it says, it is not an error of the program
    """Input that cannot be used. `kind` names the counter in /diagnostics; the text holds the offending value."""

    def __init__(self, kind: str, detail: str) -> None:
        super().__init__(detail)
        self.kind = kind
