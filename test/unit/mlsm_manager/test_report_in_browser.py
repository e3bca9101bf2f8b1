"""report.html in a real browser, without a network: one page, of a long mission with a large map."""

import pytest
from made_missions import mission

pytest.importorskip("selenium", reason="selenium is not installed")
page = pytest.importorskip("mlsm_manager.report.page", reason="plotly is not installed")
from selenium.webdriver.common.by import By  # noqa: E402
from selenium.webdriver.common.keys import Keys  # noqa: E402

pytestmark = pytest.mark.long

BROWSER = ("--enable-unsafe-swiftshader", "--window-size=400,400", "--host-resolver-rules=MAP * ~NOTFOUND")
BLOCKS, SCANS = 300_000, 200
SHOWN = """
const traces = document.getElementById('above').data.slice(-2);
return traces.map(trace => [trace.x[0], trace.y[0], trace.x.length]);
"""


@pytest.fixture(scope="module")
def report(browser, tmp_path_factory):
    """Return the browser with the report opened."""
    file = tmp_path_factory.mktemp("report") / "report.html"
    page.write_report(file, mission(block_count=BLOCKS, scans=SCANS))
    browser.get(file.as_uri())
    return browser


def severe(browser):
    return [entry["message"] for entry in browser.get_log("browser") if entry["level"] == "SEVERE"]


def test_a_map_of_300000_blocks_opens_without_an_error(report):
    assert report.execute_script("return document.getElementById('solid')._fullData[0].x.length") == 100_000
    assert severe(report) == []


def test_all_figures_are_drawn(report):
    for name in ("above", "solid", "correction", "health"):
        figure = report.find_element(By.ID, name)
        assert figure.find_elements(By.CSS_SELECTOR, ".main-svg, canvas"), name
    assert "trust:" in report.find_element(By.CLASS_NAME, "summary").text


def test_the_slider_shows_the_scan_of_its_moment(report):
    slider = report.find_element(By.ID, "time")
    slider.send_keys(Keys.HOME)
    assert report.execute_script(SHOWN)[0] == [pytest.approx(-30.0, abs=0.01), pytest.approx(40.0, abs=0.01), 500]
    slider.send_keys(Keys.ARROW_RIGHT * 3)
    scan, vehicle = report.execute_script(SHOWN)
    assert scan == [pytest.approx(-27.0, abs=0.01), pytest.approx(43.0, abs=0.01), 500]
    assert vehicle[2] == 1
    assert report.find_element(By.ID, "told").text == "4 of 200, 59 s, 500 echoes"
    slider.send_keys(Keys.END)
    assert report.find_element(By.ID, "told").text.startswith("200 of 200")
    assert severe(report) == []
