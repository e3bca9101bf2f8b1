"""The page docs/results.md: its sections, its Markdown, and what stays of it when some sections are computed anew."""

import datetime as dt
import platform
import re
import subprocess
from dataclasses import dataclass
from pathlib import Path
from typing import Callable, Dict, Mapping, Sequence, Set, Tuple
from xml.etree import ElementTree as ET

import matplotlib as mpl
import numpy as np
import scipy as sp
from benchmarks.harness import ROOT

from node_support.files import write_whole

_INTRODUCTION = """# Results

The results of the thesis's chapter 7, computed with this package, and more that the thesis could not show.

    scripts/results                 # everything, some minutes
    scripts/results 7.4 marina      # these chapters and sections only; the others stay as they are

`scripts/results` writes this page and its pictures; nothing in it was typed by hand. Random numbers are seeded: the
same version gives the same figures. Sections of real recordings stay as they are where these are not at hand."""
_NOT_YET = "Not computed yet."
_SECTION = re.compile(r"^## ([^\n]+)\n(.*?)(?=^## |\Z)", re.MULTILINE | re.DOTALL)
_COMPUTING = ("src", "scripts", "nodes", "yaml", "worlds", "urdf")


@dataclass(frozen=True)
class Section:
    """One part of the page that is computed at once.

    word: names it on the command line. chapter: of the thesis, or "beyond". make: takes Pictures, saves those of the
    section and returns its Markdown. recordings: names of the files that it needs.
    """

    word: str
    chapter: str
    title: str
    make: Callable[..., str]
    recordings: Tuple[str, ...] = ()

    @property
    def names(self) -> Set[str]:
        """What chooses it on the command line: its word, its chapter, or the chapter that this is a part of."""
        return {self.word, self.chapter, self.chapter.split(".")[0]}

    @property
    def heading(self) -> str:
        """Heading on the page, the same from run to run."""
        return f"{self.chapter} {self.title}" if self.chapter[0].isdigit() else self.title


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
    rows = []
    for section in sections:
        # As GitHub makes the anchor of a heading.
        anchor = re.sub(r"[^\w\- ]", "", section.heading.lower()).replace(" ", "-")
        rows.append([f"[{section.heading}](#{anchor})", f"`{section.word}`", ", ".join(section.recordings)])
    return table(["section", "word for `scripts/results`", "real recordings"], rows)


def made_with(seconds: float) -> str:
    """Return the line that says so; `seconds`: CPU time of the section."""
    version = ET.parse(str(ROOT / "package.xml")).getroot().findtext("version")
    libraries = ", ".join(f"{library.__name__} {library.__version__}" for library in (np, sp, mpl))
    return (
        f"*Computed on {dt.date.today().isoformat()} with version {version} (commit {_commit()}), "
        f"Python {platform.python_version()}, {libraries}; {seconds:.0f} s of CPU time.*"
    )


def _commit() -> str:
    """Return the commit that is checked out, with a + where what computes differs from it."""
    try:
        changed = _git("status", "--porcelain", "--", *_COMPUTING)
        return _git("rev-parse", "--short=8", "HEAD") + ("+" if changed else "")
    except (OSError, subprocess.CalledProcessError):
        return "unknown"


def _git(*words: str) -> str:
    command = ["git", "-C", str(ROOT), *words]
    return subprocess.run(command, stdout=subprocess.PIPE, check=True, text=True).stdout.strip()
