"""Makes docs/pictures/report*.png: missions are mapped, and a browser shows what map_bag reported of them."""

import argparse
import io
import shutil
import subprocess
import sys
import tempfile
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Callable, Dict, Iterator, List

from benchmarks.harness import ROOT, recorded
from PIL import Image
from selenium import webdriver
from selenium.webdriver.chrome.options import Options
from selenium.webdriver.chrome.service import Service
from selenium.webdriver.common.by import By
from selenium.webdriver.support.ui import WebDriverWait

PICTURES = ROOT / "docs/pictures"
MARINA = "marina_first.bag"
WIDTH, _HEIGHT = 1000, 1600  # pixels of the browser's window, which holds the whole map from above
_OPTIONS = ("--headless=new", "--no-sandbox", "--disable-dev-shm-usage", "--enable-unsafe-swiftshader")
_SCROLL_BAR = 15  # pixels
_COLOURS = 200  # a picture of few colours takes a third of the bytes
_WRONG_WIDTH, _WRONG_SHARE = 1680, 0.86  # pixels of three maps side by side; their height without the legend
_PATIENCE = 60.0  # s until a report is drawn
_CHOOSE = """
const slider = document.getElementById('time');
slider.value = Math.round(slider.max / 2);
slider.dispatchEvent(new Event('input'));
"""
_IS_DRAWN = """
const plots = [...document.querySelectorAll('.js-plotly-plot')];
return plots.length > 0 && plots.every(plot => plot._fullData);
"""


class Reports:
    """Maps recordings and opens what was reported of them; each is mapped once."""

    def __init__(self, folder: Path, browser: webdriver.Chrome) -> None:
        self.browser = browser
        self._folder = folder

    def harbour(self, scale_error: float = 0.02) -> Path:
        """Return a simulated tour of the harbour whose odometry is so much too short."""
        bag = self._folder / f"scale_{scale_error}/harbour.bag"
        if not bag.exists():
            bag.parent.mkdir()
            _run(
                "simulate_bag",
                "--world",
                "harbour",
                "--out",
                bag,
                "--quiet",
                "--set",
                f"odometry.scale_error={scale_error}",
            )
        return bag

    def open(self, bag: Path, *options: str) -> None:
        """Show the report of a recording."""
        out = self._folder / "_".join([bag.parent.name, bag.stem, *options]).replace("/", "")
        if not out.exists():
            _run("map_bag", bag, "--out", out, "--refine", *options)
        self.browser.set_window_size(WIDTH, _HEIGHT)
        self.browser.get((out / "report.html").as_uri())
        self._wait()

    def whole(self) -> Image.Image:
        """Return the page from top to bottom, with the slider in the middle."""
        self.browser.execute_script(_CHOOSE)
        self.browser.set_window_size(WIDTH, self.browser.execute_script("return document.body.scrollHeight") + 150)
        self._wait()
        return _image(self.browser.get_screenshot_as_png())

    def above(self) -> Image.Image:
        """Return the map from above alone."""
        return _image(self.browser.find_element(By.ID, "above").screenshot_as_png)

    def top_of(self, heading: str) -> int:
        """Return where on the page a heading begins, pixels."""
        (found,) = [one for one in self.browser.find_elements(By.CSS_SELECTOR, "h2") if one.text == heading]
        return int(found.rect["y"]) - 10

    def _wait(self) -> None:
        WebDriverWait(self.browser, _PATIENCE).until(lambda browser: browser.execute_script(_IS_DRAWN))


def marina(reports: Reports) -> Image.Image:
    """The beginning of the report of the marina's first 20 minutes."""
    reports.open(recorded(MARINA))
    return _part(reports, "", "Map in 3-D")


def harbour(reports: Reports) -> Image.Image:
    """The beginning of the report of the harbour."""
    reports.open(reports.harbour(), "--truth", "/ground_truth")
    return _part(reports, "", "Map in 3-D")


def trust(reports: Reports) -> Image.Image:
    """What the same report says of itself."""
    reports.open(reports.harbour(), "--truth", "/ground_truth")
    return _part(reports, "Odometry and correction", "Parameters")


def wrong(reports: Reports) -> Image.Image:
    """The map as it should be, with a head that turns the other way, and with thrusters taken for a DVL."""
    maps = []
    for bag, *options in (
        (reports.harbour(),),
        (reports.harbour(), "--set", "head_turns=CLOCKWISE"),
        (reports.harbour(0.3), "--odometry", "dvl"),
    ):
        reports.open(bag, "--truth", "/ground_truth", *options)
        maps.append(reports.above())
    width, height = maps[0].size
    together = Image.new("RGB", (len(maps) * width, int(height * _WRONG_SHARE)), "white")
    for place, picture in enumerate(maps):
        together.paste(picture.crop((0, 0, width, together.height)), (place * width, 0))
    return together.resize((_WRONG_WIDTH, _WRONG_WIDTH * together.height // together.width), Image.LANCZOS)


TAKEN: Dict[str, Callable[[Reports], Image.Image]] = {
    "report": marina,
    "report_harbour": harbour,
    "report_trust": trust,
    "report_wrong": wrong,
}


def _part(reports: Reports, first: str, behind: str) -> Image.Image:
    page = reports.whole()
    top = reports.top_of(first) if first else 0
    return page.crop((0, top, WIDTH - _SCROLL_BAR, reports.top_of(behind)))


def _image(png: bytes) -> Image.Image:
    return Image.open(io.BytesIO(png)).convert("RGB")


def _run(program: str, *arguments: Any) -> None:
    subprocess.run(
        [sys.executable, str(ROOT / "nodes" / program), *map(str, arguments)], check=True, stdout=subprocess.DEVNULL
    )


@contextmanager
def _browser() -> Iterator[webdriver.Chrome]:
    options = Options()
    for option in _OPTIONS:
        options.add_argument(option)
    options.binary_location = shutil.which("chromium")
    browser = webdriver.Chrome(service=Service(shutil.which("chromedriver")), options=options)
    try:
        yield browser
    finally:
        browser.quit()


def main() -> None:
    """Take the pictures that were asked for, all of them when none was."""
    parser = argparse.ArgumentParser(prog="scripts/report_pictures", description=__doc__)
    parser.add_argument("chosen", nargs="*", metavar="PICTURE", help=", ".join(TAKEN))
    chosen: List[str] = parser.parse_args().chosen or list(TAKEN)
    if set(chosen) - set(TAKEN):
        parser.error(f"{', '.join(sorted(set(chosen) - set(TAKEN)))}: must be among {', '.join(TAKEN)}")
    with tempfile.TemporaryDirectory() as folder, _browser() as browser:
        reports = Reports(Path(folder), browser)
        for name in chosen:
            if name == "report" and not recorded(MARINA).is_file():
                print(f"{name}: left as it is, {MARINA} is not there; set UMC_DATA", file=sys.stderr)
                continue
            picture = TAKEN[name](reports).quantize(_COLOURS, method=Image.FASTOCTREE, dither=Image.NONE)
            picture.save(str(PICTURES / f"{name}.png"), optimize=True)
            print(f"docs/pictures/{name}.png", flush=True)


if __name__ == "__main__":
    main()
