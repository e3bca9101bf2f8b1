"""The first commands of docs/tutorial_first_map.md print what the page says that they print."""

import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PAGE = (ROOT / "docs/tutorial_first_map.md").read_text()
COMMANDS = re.findall(r"^    rosrun underwater_map_construction ((?:simulate_bag|map_bag harbour).*)$", PAGE, re.M)
FIGURES = re.compile(r"^ *(dead_reckoning|corrected|refined): mean (\S+) m, sd (\S+) m, max (\S+) m$", re.M)
COUNTS = re.compile(r"(\d+) scans, (\d+) matched, (\d+) rejected")


@pytest.fixture(scope="module")
def printed(tmp_path_factory):
    """Return what the commands print, one after the other in one folder."""
    folder, output = tmp_path_factory.mktemp("tutorial"), ""
    for command in COMMANDS:
        name, *arguments = shlex.split(command)
        program = [sys.executable, str(ROOT / "nodes" / name), *arguments]
        output += subprocess.run(program, cwd=str(folder), stdout=subprocess.PIPE, check=True, text=True).stdout
    return output


def test_the_first_map_is_as_exact_as_the_page_says(printed):
    """Processors round differently; 5 mm are less than any difference that the page speaks of."""
    found, said = (
        {name: list(map(float, values)) for name, *values in FIGURES.findall(one)} for one in (printed, PAGE)
    )
    assert set(found) == set(said) == {"dead_reckoning", "corrected", "refined"}
    for name, values in said.items():
        assert found[name] == pytest.approx(values, abs=5e-3)


def test_the_first_map_matches_as_many_scans_as_the_page_says(printed):
    assert COUNTS.search(printed).groups() == COUNTS.search(PAGE).groups()
