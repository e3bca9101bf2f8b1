"""scripts/results: what of the page it replaces, and how large its pictures may be."""

import sys

import numpy as np
import pytest
from benchmarks.harness import ROOT
from thesis_results import __main__ as program
from thesis_results.__main__ import SECTIONS
from thesis_results.page import Section, sections_of, write_page
from thesis_results.pictures import MOST_BYTES, Pictures, new_figure


def _section(word, chapter="7.1", recordings=()):
    return Section(word, chapter, word.capitalize(), lambda pictures: f"{word} is made", recordings)


@pytest.fixture
def page(tmp_path, monkeypatch):
    """Return the page of a program with two sections, one of which needs a recording."""
    sections = (_section("waves"), _section("harbour", recordings=("harbour.bag",)), _section("noise", "beyond"))
    monkeypatch.setattr(program, "SECTIONS", sections)
    monkeypatch.setattr(program, "PAGE", tmp_path / "results.md")
    monkeypatch.setattr(program, "PICTURES", tmp_path / "pictures")
    monkeypatch.setenv("UMC_DATA", str(tmp_path))
    return tmp_path / "results.md"


def _run(monkeypatch, *words):
    monkeypatch.setattr(sys, "argv", ["scripts/results", *words])
    program.main()


@pytest.mark.parametrize("word", ["waves", "7.1", "7"])
def test_a_chapter_alone_leaves_the_other_sections_as_they_are(page, monkeypatch, word):
    write_page(page, program.SECTIONS, {"Noise": "as it was"})
    _run(monkeypatch, word)
    sections = sections_of(page.read_text())
    assert sections["7.1 Waves"].startswith("waves is made")
    assert sections["Noise"] == "as it was"


def test_a_section_whose_recording_is_missing_stays_and_says_so_in_one_line(page, monkeypatch, capsys):
    write_page(page, program.SECTIONS, {"7.1 Harbour": "as it was"})
    _run(monkeypatch)
    assert sections_of(page.read_text())["7.1 Harbour"] == "as it was"
    (line,) = capsys.readouterr().err.splitlines()
    assert "7.1 Harbour: left as it is, harbour.bag" in line


def test_every_section_says_with_what_it_was_computed(page, monkeypatch):
    (page.parent / "harbour.bag").touch()
    _run(monkeypatch)
    for body in sections_of(page.read_text()).values():
        assert "Computed on" in body
        assert f"numpy {np.__version__}" in body


def test_a_section_that_is_gone_leaves_the_page(page):
    write_page(page, [_section("old")], {"7.1 Old": "text"})
    write_page(page, [_section("new")], {"7.1 New": "text"})
    assert list(sections_of(page.read_text())) == ["7.1 New"]


def test_an_unknown_chapter_is_refused_with_those_there_are(page, monkeypatch, capsys):
    with pytest.raises(SystemExit):
        _run(monkeypatch, "7.9")
    assert "7.9: must be among 7.1, beyond, waves, harbour, noise" in capsys.readouterr().err
    assert not page.exists()


def test_a_picture_of_noise_is_drawn_more_coarsely_until_it_is_small(tmp_path):
    figure, ((axes,),) = new_figure(6.0, 6.0)
    axes.imshow(np.random.RandomState(1).rand(600, 600))
    text = Pictures(tmp_path / "pictures", tmp_path / "page.md").save("noise", figure, "Only  noise.")
    assert text == "![noise](pictures/noise.png)\n\n*Only noise.*"
    assert 0 < (tmp_path / "pictures" / "noise.png").stat().st_size <= MOST_BYTES


def test_words_and_headings_of_sections_differ():
    for names in ({section.word for section in SECTIONS}, {section.heading for section in SECTIONS}):
        assert len(names) == len(SECTIONS)


def test_the_committed_page_has_all_sections_computed():
    text = (ROOT / "docs" / "results.md").read_text()
    assert list(sections_of(text)) == [section.heading for section in SECTIONS]
    assert "Not computed yet" not in text


def test_the_pictures_stay_small_together():
    files = (ROOT / "docs" / "pictures").rglob("*.png")
    assert sum(path.stat().st_size for path in files) <= 4_000_000
