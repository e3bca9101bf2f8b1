"""The sections of scripts/results that take a few seconds, so that no change of a library breaks them unseen."""

import re

import pytest
from thesis_results.__main__ import SECTIONS
from thesis_results.pictures import MOST_BYTES, Pictures

QUICK = ("recorded", "processing-recorded")


@pytest.mark.parametrize("section", [one for one in SECTIONS if one.word in QUICK], ids=lambda one: one.word)
def test_a_section_is_computed_with_its_pictures(section, recording, tmp_path):
    for name in section.recordings:
        recording(name)
    text = section.make(Pictures(tmp_path / "pictures", tmp_path / "page.md"))
    shown = re.findall(r"\]\((pictures/\w+\.png)\)", text)
    assert shown
    for link in shown:
        assert 0 < (tmp_path / link).stat().st_size <= MOST_BYTES
    assert "nan" not in text
