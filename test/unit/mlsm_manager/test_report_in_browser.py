"""report.html in a real browser, without a network."""

import shutil
from pathlib import Path

import pytest
from made_missions import mission, verdict

webdriver = pytest.importorskip("selenium.webdriver", reason="selenium is not installed")
page = pytest.importorskip("mlsm_manager.report.page", reason="plotly is not installed")
from selenium.webdriver.chrome.options import Options  # noqa: E402
from selenium.webdriver.chrome.service import Service  # noqa: E402
from selenium.webdriver.common.by import By  # noqa: E402
from selenium.webdriver.common.keys import Keys  # noqa: E402

OPTIONS = (
    "--headless=new", "--no-sandbox", "--disable-dev-shm-usage", "--enable-unsafe-swiftshader",
    "--window-size=1200,1600", "--host-resolver-rules=MAP * ~NOTFOUND",
)  # fmt: skip
SHOWN = """
const traces = document.getElementById('above').data.slice(-2);
return traces.map(trace => [trace.x[0], trace.y[0], trace.x.length]);
"""


@pytest.fixture(scope="module")
def browser():
    program, driver = (shutil.which(name) for name in ("chromium", "chromedriver"))
    if program is None or driver is None:
        pytest.skip("chromium and chromedriver are not installed")
    options = Options()
    for option in OPTIONS:
        options.add_argument(option)
    options.binary_location = program
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    opened = webdriver.Chrome(service=Service(driver), options=options)
    yield opened
    opened.quit()


def open_report(browser, folder, **made):
    file = Path(folder) / "report.html"
    page.write_report(file, mission(**made))
    browser.get(file.as_uri())


def severe(browser):
    return [entry["message"] for entry in browser.get_log("browser") if entry["level"] == "SEVERE"]


def test_the_slider_shows_the_scan_of_its_moment(browser, tmp_path):
    open_report(browser, tmp_path, verdicts=[verdict(1.0)])
    assert browser.execute_script(SHOWN)[0] == [pytest.approx(-30.0, abs=0.01), pytest.approx(40.0, abs=0.01), 500]
    browser.find_element(By.ID, "time").send_keys(Keys.ARROW_RIGHT * 3)
    scan, vehicle = browser.execute_script(SHOWN)
    assert scan == [pytest.approx(-27.0, abs=0.01), pytest.approx(43.0, abs=0.01), 500]
    assert vehicle[2] == 1
    assert browser.find_element(By.ID, "told").text == "4 of 20, 59 s, 500 echoes"
    assert severe(browser) == []


def test_all_figures_are_drawn(browser, tmp_path):
    open_report(browser, tmp_path)
    for name in ("above", "solid", "correction", "health"):
        figure = browser.find_element(By.ID, name)
        assert figure.find_elements(By.CSS_SELECTOR, ".main-svg, canvas"), name
    assert "All checks are fine" not in browser.find_element(By.CLASS_NAME, "summary").text
    assert severe(browser) == []


def test_a_map_of_300000_blocks_opens_without_an_error(browser, tmp_path):
    open_report(browser, tmp_path, block_count=300_000, scans=200)
    browser.find_element(By.ID, "time").send_keys(Keys.END)
    assert browser.find_element(By.ID, "told").text.startswith("200 of 200")
    assert browser.execute_script("return document.getElementById('solid')._fullData[0].x.length") == 100_000
    assert severe(browser) == []
