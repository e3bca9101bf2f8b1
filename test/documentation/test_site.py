"""README.md and the pages of docs/ build to a site, which a browser shows from files."""

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
DOCS = sorted((ROOT / "docs").glob("*.md"))
BROWSER = ("--disable-gpu", "--window-size=390,844")


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """Build the site and return its folder, and what sphinx printed."""
    for name in ("sphinx", "myst_parser", "furo"):
        pytest.importorskip(name, reason=f"{name} is not installed")
    folder = tmp_path_factory.mktemp("site")
    options = ["-q", "-W", "--keep-going", "-n", "-b", "html", "-c", "docs", "-d", str(folder / "cache")]
    command = [sys.executable, "-m", "sphinx", *options, ".", str(folder)]
    done = subprocess.run(command, cwd=str(ROOT), stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    return folder, (done.returncode, done.stdout)


def test_the_pages_build_to_a_site_without_a_warning(site):
    folder, printed = site
    assert printed == (0, "")
    assert {path.stem for path in (folder / "docs").glob("*.html")} == {path.stem for path in DOCS}


@pytest.mark.parametrize("page", ["README", "docs/map_bag"])
def test_a_phone_shows_a_page_from_its_file_whole_and_without_an_error(site, browser, page):
    browser.get((site[0] / f"{page}.html").as_uri())
    assert browser.get_log("browser") == []
    assert browser.execute_script("return document.documentElement.scrollWidth <= window.innerWidth")
