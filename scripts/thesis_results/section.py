"""What a section of the page is."""

from dataclasses import dataclass
from typing import Callable, Tuple

from thesis_results.pictures import Pictures


@dataclass(frozen=True)
class Section:
    """One part of the page that is computed at once.

    word: names it on the command line. chapter: of the thesis, or "beyond". make: computes it, saves its pictures and
    returns its Markdown. recordings: names of the files that it needs.
    """

    word: str
    chapter: str
    title: str
    make: Callable[[Pictures], str]
    recordings: Tuple[str, ...] = ()

    @property
    def heading(self) -> str:
        """Heading on the page, the same from run to run."""
        return f"{self.chapter} {self.title}" if self.chapter[0].isdigit() else self.title
