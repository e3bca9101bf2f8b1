"""scripts/results: the page that it made, and how large its pictures are."""

from benchmarks.harness import ROOT
from thesis_results.__main__ import SECTIONS
from thesis_results.page import sections_of


def test_the_committed_page_has_all_sections_computed():
    text = (ROOT / "docs" / "results.md").read_text()
    assert list(sections_of(text)) == [section.heading for section in SECTIONS]
    assert "Not computed yet" not in text


def test_the_pictures_stay_small_together():
    files = (ROOT / "docs" / "pictures").rglob("*.png")
    assert sum(path.stat().st_size for path in files) <= 4_000_000
