"""The page in a real browser, with a real master and mlsm_core: it draws, follows, marks, and comes back by itself."""

import json
import subprocess
import sys
from contextlib import suppress
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from threading import Thread
from urllib.request import urlopen

import numpy as np
import pytest
from stopwatch import ROOT, START_TIMEOUT, free_port, wait_until
from test_master_restart import Master

from georeferencing.origin import Origin
from mlsm_manager.surface_map.map_file import read_map

BROWSER = ("--disable-gpu", "--window-size=1000,700")
# The darkest blue (0 to 255) that is drawn within a metre of a point of the map.
DARKEST = """
window.darkest = (point) => {
const {map} = page, [x, y] = map.toScreen(point), half = Math.ceil(map.scale);
const {data} = map.context.getImageData((x - half) * map.ratio, (y - half) * map.ratio, 2 * half, 2 * half);
return data.filter((_, i) => i % 4 === 2).reduce((least, one) => Math.min(least, one), 255);
}"""
WALL, WATER = [0.0, 12.0], [8.0, 5.0]
ORIGIN = Origin(41.2, 3.1, 120.0)


class Site:
    """A master, the nodes, and a browser that looks; what ends is started again as roslaunch would do it."""

    def __init__(self, browser, folder):
        self.browser, self.port, self.folder = browser, free_port(), folder
        self.master = Master(folder)
        self.environment = {**self.master.environment, "ROS_HOME": str(folder)}
        self.nodes = {}
        self.start_nodes()

    def start_nodes(self):
        parameters = "_sonar_delay_deviation:=0.0", "_autosave_period:=0.0", f"_origin:={ORIGIN}"
        self.start("mlsm_core", "nodes/mlsm_core", *parameters)
        self.start("feeder", "test/stopping/web_page_feeder.py")
        self.start_page()

    def start_page(self):
        self.start("web_page", "nodes/web_page", f"_port:={self.port}")

    def start(self, name, program, *arguments):
        command = [sys.executable, str(ROOT / program), f"__name:={name}", *arguments]
        self.nodes[name] = subprocess.Popen(command, env=self.environment, stdout=subprocess.DEVNULL)

    def kill(self, *names):
        for name in names:
            self.nodes[name].kill()
            self.nodes.pop(name).wait()

    def open_page(self):
        wait_until(self.is_served, told="the page is served")
        self.browser.get(f"http://127.0.0.1:{self.port}/?theme=light")

    def is_served(self):
        with suppress(OSError):
            urlopen(f"http://127.0.0.1:{self.port}/", timeout=5).close()
            return True
        return False

    def run(self, script, *arguments):
        return self.browser.execute_script(script, *arguments)

    def wait(self, condition):
        """Wait until an expression of the page is true."""
        wait_until(lambda: self.run(f"return Boolean({condition})"), told=condition)

    def errors(self):
        """Return what the console says, but for links that are refused while there is no server."""
        said = [entry["message"] for entry in self.browser.get_log("browser") if entry["level"] == "SEVERE"]
        return [line for line in said if "WebSocket connection to" not in line]

    def hosts(self):
        events = [json.loads(entry["message"])["message"] for entry in self.browser.get_log("performance")]
        urls = [one["params"]["request"]["url"] for one in events if one["method"] == "Network.requestWillBeSent"]
        return {url.split("/")[2] for url in urls if not url.startswith("data:")}


@pytest.fixture(scope="module")
def site(browser, tmp_path_factory):
    """Return what runs, with the page open as soon as it is served."""
    made = Site(browser, tmp_path_factory.mktemp("site"))
    try:
        made.open_page()
        yield made
    finally:
        made.kill(*list(made.nodes))
        made.master.stop()


def test_1_the_map_the_sonar_and_the_position_are_drawn(site):
    site.wait("page.model.now?.waiting === '' && page.sonar.beams.size > 20")
    # The first scan has no odometry of its beginning; later ones hold all walls.
    site.wait("page.model.now.fixes > 1 && page.model.now.status.text.startsWith('position ')")
    site.run("document.getElementById('overlay').click(); document.getElementById('whole').click()")
    site.wait("document.querySelector('#position span').textContent.startsWith('position ')")
    site.run(DARKEST)
    site.wait(f"darkest({WALL}) < 150 && darkest({WATER}) > 220")
    assert site.run("return document.getElementById('depth').textContent") == "2.0 m"
    assert site.run("return document.getElementById('heading').textContent") == "120°"


def test_2_the_map_follows_the_vehicle(site):
    site.run("document.getElementById('follow').click()")
    beside = "Math.hypot(page.map.centre[0] - page.model.place[0], page.map.centre[1] - page.model.place[1])"
    site.wait(f"{beside} < 0.3")
    start = site.run("return page.map.centre[0]")
    site.wait(f"page.map.centre[0] > {start} + 0.5 && {beside} < 0.3")


def test_3_the_past_is_shown_until_live_is_pressed(site):
    site.run(
        "const one = document.getElementById('time'); one.value = Math.ceil(page.model.track[0][0]); one.oninput()"
    )
    assert site.run("return page.map.shownPlace()[0] < page.model.place[0] - 1")
    site.run("document.getElementById('live').click()")
    assert site.run("return page.map.time") is None


def test_4_a_mark_lands_in_the_maps_file_and_in_geojson(site):
    site.run("""
    document.getElementById('marking').click();
    page.map.onTouch([3, -4]);
    document.getElementById('name').value = '<b>block</b> ⚓';
    document.getElementById('naming').requestSubmit();
    """)
    site.wait("page.model.marks.length")
    site.wait("document.querySelector('#marks li button')?.textContent === '<b>block</b> ⚓'")
    with urlopen(f"http://127.0.0.1:{site.port}/marks.geojson", timeout=20) as answer:
        (feature,) = json.load(answer)["features"]
    assert (feature["properties"]["x"], feature["properties"]["y"]) == (3.0, -4.0)
    latitude, longitude = ORIGIN.degrees(np.array([[3.0, -4.0]]))[0]
    assert feature["geometry"]["coordinates"] == pytest.approx([longitude, latitude], abs=1e-7)
    command = ["rosservice", "call", "/mlsm_core/save_map", "{name: marked, overwrite: true}"]
    subprocess.run(command, env=site.environment, check=True, stdout=subprocess.DEVNULL)
    (mark,) = read_map(site.folder / "maps/marked.mlsm").marks
    assert (mark.name, mark.x, mark.y) == ("<b>block</b> ⚓", 3.0, -4.0)


def test_5_no_errors_and_no_request_to_another_host(site):
    assert site.errors() == []
    assert site.hosts() == {f"127.0.0.1:{site.port}"}


def test_6_a_cut_link_is_told_and_all_is_there_again_after_it(site):
    site.kill("web_page")
    site.wait("document.getElementById('notice').textContent.startsWith('no connection since ')")
    assert site.run("return page.model.tiles.size") > 0
    site.start_page()
    site.wait("!page.connection.isCut")
    site.wait("page.model.revision && page.model.tiles.size && page.model.marks.length")
    site.wait("page.model.now?.waiting === ''")


def test_7_it_survives_a_restarted_master(site):
    before = site.run("return page.model.run")
    site.master.stop()
    site.master.start()
    # The node says that the new master does not know it, and ends; roslaunch starts it again.
    assert site.nodes.pop("web_page").wait(START_TIMEOUT) == 1
    site.kill("mlsm_core", "feeder")
    site.start_nodes()
    site.wait(f"page.model.run !== '{before}' && page.model.tiles.size && page.model.now?.waiting === ''")
    assert site.errors() == []


def test_8_it_works_in_a_frame_of_another_host_as_in_cockpit(site, tmp_path):
    frame = f"<iframe src='http://127.0.0.1:{site.port}/?widget=1' width=480 height=360></iframe>"
    (tmp_path / "index.html").write_text(frame)
    other = ThreadingHTTPServer(("127.0.0.1", 0), partial(SimpleHTTPRequestHandler, directory=str(tmp_path)))
    Thread(target=other.serve_forever, daemon=True).start()
    site.browser.get(f"http://localhost:{other.server_port}/")
    site.browser.switch_to.frame(0)
    site.wait("window.page && page.model.tiles.size && page.model.now?.waiting === ''")
    seen = "getComputedStyle(document.querySelector('{}')).display !== 'none'"
    assert site.run(f"return {seen.format('#map')} && !({seen.format('aside')})")
    assert [line for line in site.errors() if "favicon" not in line] == []
    other.shutdown()
