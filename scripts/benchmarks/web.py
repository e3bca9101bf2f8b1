"""What the page in a browser costs: demo.launch in real time without web_page, with it, and with ten pages open.

First picture: from the request until a headless Chromium has the whole map, the sonar's picture and the vehicle. Shares
are of one core. Callbacks: processing times of the stages that share mlsm_core's process, from /diagnostics.
"""

import asyncio
import json
import os
import subprocess
import sys
import time
from contextlib import suppress
from typing import Dict, List, Sequence, Tuple

from tornado.websocket import websocket_connect

from benchmarks.harness import ROOT, Row, benchmark_parser, print_table

sys.path.append(str(ROOT / "test/stopping"))
_PAGES = 10
_HELLO = json.dumps({"hello": {"run": "", "revision": 0}})
_PATIENCE = 180.0  # s until the graph runs
_WARM_UP = 60.0  # s: some scans are matched
_STAGES = {"sonar_to_cloud": "messages in", "echo_extractor": "clouds in"}
"""Stages whose callbacks are measured, and what counts them."""
_DRAWN = (
    "page.model.revision && page.model.place && page.model.tiles.size && page.sonar.beams.size && !page.map.isDirty"
)


def measured(seconds: float) -> List[Row]:
    """Return the rows of three runs of so many seconds each."""
    from stopwatch import free_port

    master, port = free_port(), free_port()
    os.environ["ROS_MASTER_URI"] = f"http://localhost:{master}"
    package, quiet = "underwater_map_construction", {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    demo = ["roslaunch", "-p", str(master), package, "demo.launch", "rviz:=false", "real_time_factor:=1.0"]
    running = [subprocess.Popen(demo, **quiet)]
    try:
        figures = Figures()
        figures.wait()
        time.sleep(_WARM_UP)
        alone = figures.over(seconds)
        running.append(subprocess.Popen(["roslaunch", "--wait", package, "web_page.launch", f"port:={port}"], **quiet))
        first = first_picture(port)
        unwatched = figures.over(seconds)
        rates, watched = asyncio.run(_watched(port, seconds, figures))
    finally:
        for one in reversed(running):
            one.terminate()
            one.wait()
    return [
        ("first picture", f"{first:.1f} s", "<= 2 s"),
        ("sent to a page, median, not compressed", f"{sorted(rates)[_PAGES // 2] / 1e3:.1f} kB/s", "<= 60 kB/s"),
        _compared("share of a core, web_page", "web_page", "%", (unwatched, watched), "<= 5 %"),
        _compared("share of a core, mapping", "mapping", "%", (alone, unwatched, watched), "the same"),
        *(_compared(f"callback of {one}", one, "ms", (alone, unwatched, watched), "the same") for one in _STAGES),
    ]


def _compared(name: str, key: str, unit: str, runs: Sequence[Dict[str, float]], wanted: str) -> Row:
    words = ("without the node", "no page", f"{_PAGES} pages")[-len(runs) :]
    return name, ", ".join(f"{word} {run[key]:.2f} {unit}" for word, run in zip(words, runs)), wanted


def first_picture(port: int) -> float:
    """Return the seconds until the page is whole in a browser that runs already."""
    from selenium import webdriver
    from selenium.webdriver.chrome.options import Options
    from selenium.webdriver.chrome.service import Service

    options = Options()
    for option in ("--headless=new", "--no-sandbox", "--disable-dev-shm-usage", "--window-size=1400,860"):
        options.add_argument(option)
    with webdriver.Chrome(service=Service("/usr/bin/chromedriver"), options=options) as browser:
        _wait_for_port(port)
        time.sleep(20.0)  # the beams of a revolution come
        start = time.monotonic()
        browser.get(f"http://127.0.0.1:{port}/")
        while not browser.execute_script(f"return Boolean(window.page && {_DRAWN})"):
            time.sleep(0.02)
        return time.monotonic() - start


def _wait_for_port(port: int) -> None:
    from urllib.request import urlopen

    end = time.monotonic() + _PATIENCE
    while time.monotonic() < end:
        with suppress(OSError):
            urlopen(f"http://127.0.0.1:{port}/", timeout=5.0).close()
            return
        time.sleep(0.2)
    sys.exit(f"the page is not served after {_PATIENCE:g} s")


async def _watched(port: int, seconds: float, figures: "Figures") -> Tuple[List[float], Dict[str, float]]:
    """Return what each of the pages got in a second, and the figures meanwhile."""
    loop = asyncio.get_event_loop()
    found = loop.run_in_executor(None, figures.over, seconds)
    rates = await asyncio.gather(*(_bytes(port, seconds) for _ in range(_PAGES)))
    return list(rates), await found


async def _bytes(port: int, seconds: float) -> float:
    page = await websocket_connect(f"ws://127.0.0.1:{port}/live", compression_options={})
    page.write_message(_HELLO)
    end, total = time.monotonic() + seconds, 0
    while time.monotonic() < end:
        total += len(await page.read_message())
    page.close()
    return total / seconds


class Figures:
    """CPU times of processes, from the system, and processing times of stages, from /diagnostics."""

    def __init__(self) -> None:
        self._stages: Dict[str, Tuple[float, float]] = {}

    def wait(self) -> None:
        """Wait until the graph runs, and listen."""
        import rosgraph
        import rospy
        from diagnostic_msgs.msg import DiagnosticArray

        end = time.monotonic() + _PATIENCE
        while not (rosgraph.is_master_online() and rosgraph.Master("/bench").hasParam("/use_sim_time")):
            if time.monotonic() > end:
                sys.exit(f"the graph does not run after {_PATIENCE:g} s")
            time.sleep(0.1)
        rospy.init_node("web_bench", anonymous=True, disable_signals=True)
        rospy.Subscriber("/diagnostics", DiagnosticArray, self._take, queue_size=100)

    def _take(self, message: object) -> None:
        for status in message.status:
            stage = status.name.rpartition(" ")[2]
            values = {pair.key: pair.value for pair in status.values}
            if stage in _STAGES and "processing time mean [ms]" in values:
                count = float(values[_STAGES[stage]])
                self._stages[stage] = count, count * float(values["processing time mean [ms]"])

    def over(self, seconds: float) -> Dict[str, float]:
        """Return shares of a core [%] by node and callback times [ms] by stage over the next seconds."""
        stages, processor = dict(self._stages), _processor_seconds()
        time.sleep(seconds)
        found = {node: 100.0 * (now - processor.get(node, 0.0)) / seconds for node, now in _processor_seconds().items()}
        for stage, (count, total) in self._stages.items():
            before = stages.get(stage, (0.0, 0.0))
            found[stage] = (total - before[1]) / max(count - before[0], 1.0)
        return found


def _processor_seconds() -> Dict[str, float]:
    """Return the CPU seconds of our nodes so far, by name."""
    import rosnode

    pids = {node: _pid(node) for node in ("mapping", "web_page") if f"/{node}" in rosnode.get_node_names()}
    ticks = os.sysconf("SC_CLK_TCK")
    found = {}
    for node, pid in pids.items():
        with open(f"/proc/{pid}/stat") as file:
            fields = file.read().rpartition(")")[2].split()
        found[node] = (int(fields[11]) + int(fields[12])) / ticks
    return found


def _pid(node: str) -> int:
    from xmlrpc.client import ServerProxy

    import rosgraph

    uri = rosgraph.Master("/bench").lookupNode(f"/{node}")
    return ServerProxy(uri).getPid("/bench")[2]


def main() -> None:
    """Print the table."""
    parser = benchmark_parser("web", __doc__)
    parser.add_argument("--seconds", type=float, default=60.0, help="how long to measure each time")
    print_table(measured(parser.parse_args().seconds))


if __name__ == "__main__":
    main()
