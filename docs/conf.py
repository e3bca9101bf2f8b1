"""Builds README.md and docs/ to a site with Sphinx: scripts/docs."""

import re
from pathlib import Path
from xml.etree import ElementTree as ET

_ROOT = Path(__file__).resolve().parents[1]
_PACKAGE = ET.parse(str(_ROOT / "package.xml")).getroot()
_PAGE = re.compile(r"\]\((docs/\w+)\.md\)")

project = _PACKAGE.findtext("name")
release = version = _PACKAGE.findtext("version")
extensions = ["myst_parser"]
root_doc = "README"
include_patterns = ["README.md", "CHANGELOG.rst", "docs/*.md", "migration/README.md"]
# Not searched for pages: build/ links back to the checkout.
exclude_patterns = [path.name for path in _ROOT.iterdir() if path.is_dir() and path.name not in ("docs", "migration")]
html_theme = "furo"
html_title = f"{project} {release}"
# Anchors of headings as GitHub makes them.
myst_heading_anchors = 4


def _add_contents(_app, page, source):
    """Give the first page the list of all pages, in the order of its table of pages, which comes last."""
    if page == root_doc:
        linked = _PAGE.findall(source[0].rpartition("## Documentation")[2])
        pages = [*dict.fromkeys(linked), "migration/README", "CHANGELOG"]
        source[0] += "\n\n```{toctree}\n:hidden:\n\n" + "\n".join(pages) + "\n```\n"


def setup(app):
    """Called by Sphinx."""
    app.connect("source-read", _add_contents)
