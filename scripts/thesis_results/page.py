"""The page: what is computed replaces what stood there, all other sections stay."""

import re
from pathlib import Path
from typing import Dict, Mapping, Sequence

from node_support.files import write_whole
from thesis_results.markdown import joined, table
from thesis_results.section import Section

_INTRODUCTION = """# Results

The results of the thesis's chapter 7, computed with this package, and more that the thesis could not show.

    scripts/results                 # everything, some minutes
    scripts/results 7.4 marina      # these chapters and sections only; the others stay as they are

`scripts/results` writes this page and its pictures; nothing in it was typed by hand. Random numbers are seeded: the
same version gives the same figures. Sections of real recordings stay as they are where these are not at hand."""
_NOT_YET = "Not computed yet."
_SECTION = re.compile(r"^## ([^\n]+)\n(.*?)(?=^## |\Z)", re.MULTILINE | re.DOTALL)


def sections_of(text: str) -> Dict[str, str]:
    """Return the body of each section of a page by its heading."""
    return {heading: body.strip() for heading, body in _SECTION.findall(text)}


def write_page(path: Path, sections: Sequence[Section], made: Mapping[str, str]) -> None:
    """Write the page; `made` has the new bodies by heading, the others stay as they are in the file."""
    before = sections_of(path.read_text()) if path.exists() else {}
    bodies = {section.heading: _NOT_YET for section in sections}
    bodies.update({heading: body for heading, body in {**before, **made}.items() if heading in bodies})
    parts = [f"## {heading}\n\n{body}" for heading, body in bodies.items()]
    write_whole(path, (joined(_INTRODUCTION, _contents(sections), *parts) + "\n").encode())


def _contents(sections: Sequence[Section]) -> str:
    rows = [
        [f"[{section.heading}](#{_anchor(section.heading)})", f"`{section.word}`", ", ".join(section.recordings)]
        for section in sections
    ]
    return table(["section", "word for `scripts/results`", "real recordings"], rows)


def _anchor(heading: str) -> str:
    """Return the anchor that GitHub makes of a heading."""
    return re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-")
