import os
import shutil
import sys
from pathlib import Path

# As the programs do, before anything loads numpy: the matrices are small, and threads would wait for each other.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import pytest

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "scripts"))


@pytest.fixture(scope="session")
def recording():
    """Return a function that gives the path of a recording, and skips what needs it, saying so, where it is absent."""

    def found(name):
        path = Path(os.environ.get("UMC_DATA", ROOT.parent / "shared" / "data")) / name
        if not path.is_file():
            pytest.skip(f"{path} is not there; set UMC_DATA to the folder of the recordings")
        return path

    return found


@pytest.fixture(scope="module")
def browser(request):
    """Return Chromium without a window, started with the options BROWSER of the test's module."""
    webdriver = pytest.importorskip("selenium.webdriver", reason="selenium is not installed")
    from selenium.webdriver.chrome.service import Service

    program, driver = (shutil.which(name) for name in ("chromium", "chromedriver"))
    if program is None or driver is None:
        pytest.skip("chromium and chromedriver are not installed")
    options = webdriver.ChromeOptions()
    for option in ("--headless=new", "--no-sandbox", "--disable-dev-shm-usage", *request.module.BROWSER):
        options.add_argument(option)
    options.binary_location = program
    options.set_capability("goog:loggingPrefs", {"browser": "ALL", "performance": "ALL"})
    opened = webdriver.Chrome(service=Service(driver), options=options)
    yield opened
    opened.quit()
