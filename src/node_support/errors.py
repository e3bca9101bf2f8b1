"""The exception with which a core refuses data that it cannot use, and numbers in such texts."""


class RefusedInput(ValueError):  # noqa: N818 - named for what it says, it is not an error of the program
    """Input that cannot be used. `kind` names the counter in /diagnostics; the text holds the offending value."""

    def __init__(self, kind: str, detail: str) -> None:
        super().__init__(detail)
        self.kind = kind


def counted(number: int, noun: str) -> str:
    """Return a number of things whose plural ends with s."""
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"
