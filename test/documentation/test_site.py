"""README.md and the pages of docs/ build to a site."""

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
DOCS = sorted((ROOT / "docs").glob("*.md"))


def test_the_pages_build_to_a_site_without_a_warning(tmp_path):
    for name in ("sphinx", "myst_parser", "furo"):
        pytest.importorskip(name, reason=f"{name} is not installed")
    options = ["-q", "-W", "--keep-going", "-n", "-b", "html", "-c", "docs", "-d", str(tmp_path / "cache")]
    command = [sys.executable, "-m", "sphinx", *options, ".", str(tmp_path / "site")]
    done = subprocess.run(command, cwd=str(ROOT), stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    assert (done.returncode, done.stdout) == (0, "")
    assert {path.stem for path in (tmp_path / "site" / "docs").glob("*.html")} == {path.stem for path in DOCS}
