"""Programs read damaged files of every kind or refuse them in one line; scripts/fuzz damages ten times as many."""

import sys
from pathlib import Path

import pytest

sys.path += [str(Path(__file__).resolve().parent / folder) for folder in ("recordings", "imagenex_852_driver")]

pytestmark = [pytest.mark.long, pytest.mark.newest_only("of each kind, thirty programs are run")]


def test_no_damaged_file_is_answered_badly(tmp_path):
    from fuzz_files.__main__ import fuzz
    from fuzz_files.samples import samples

    assert [line for one in samples(tmp_path) for line in fuzz(one, 30, 1, tmp_path)] == []
