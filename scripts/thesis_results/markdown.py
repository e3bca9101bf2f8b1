"""Tables of the page."""

from typing import Sequence


def table(heading: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return a Markdown table."""
    lines = [heading, ["---"] * len(heading), *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def prose(text: str) -> str:
    """Return a paragraph in one line, however it was broken in the code."""
    return " ".join(text.split())


def joined(*parts: str) -> str:
    """Return paragraphs, tables and pictures with blank lines between them."""
    return "\n\n".join(part.strip() for part in parts)
