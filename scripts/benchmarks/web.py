"""What the page in a browser costs: demo.launch in real time, in turns without web_page, with it, and with ten pages.

First picture: from the request until a headless Chromium has the whole map, the sonar's picture and the vehicle. Shares
are of one core. Each turn is as long as the others and they follow each other round and round, so that what the mission
itself changes is in all of them; figures are medians of the rounds. The nodes share core 0,
pages have the others.
"""

import asyncio
import json
import os
import time
from contextlib import contextmanager
from typing import Any, Dict, Iterator, List, Tuple
from urllib.request import urlopen

import numpy as np
from soaking.processes import held_below
from tornado.websocket import websocket_connect

from benchmarks.harness import Row, say
from benchmarks.programs import free_port, running, wait_for_graph, wait_until

_PAGES = 10
HELLO = json.dumps({"hello": {"run": "", "revision": 0}})
"""With which a page begins that has nothing yet."""
_WARM_UP = 40.0  # s: some scans are matched
_REVOLUTION = 20.0  # s until all beams of one have come
_TURNS = ("without the node", "no page", f"{_PAGES} pages")
_STAGES = {"sonar_to_cloud": "messages in", "echo_extractor": "clouds in"}
"""Stages whose callbacks are measured, and what counts them."""
_PER_BEAM = "per beam"
_DRAWN = (
    "page.model.revision && page.model.place && page.model.tiles.size && page.sonar.beams.size && !page.map.isDirty"
)
Turn = Dict[str, float]
"""Figures of one turn by name."""


def rows(seconds: float = 30.0, rounds: int = 2) -> List[Row]:
    """Return the rows of so many rounds of three turns of so many seconds each."""
    port, turns, rates, first = free_port(), [], [], np.nan
    with running(before="taskset -c 0") as programs:
        programs.demo()
        # Pages are on other computers.
        os.sched_setaffinity(0, set(range(1, os.cpu_count() or 1)) or {0})
        figures = Figures()
        say(f"the vehicle maps for {_WARM_UP:g} s first")
        time.sleep(_WARM_UP)
        for number in range(rounds):
            say(f"round {number + 1} of {rounds}: {seconds:g} s each of {', '.join(_TURNS)}")
            turns.append([figures.over(seconds)])
            node = programs.launch("web_page.launch", f"port:={port}")
            wait_until(lambda: _is_served(port), "the page")
            if number == 0:
                time.sleep(_REVOLUTION)
                with chromium() as browser:
                    first = first_picture(browser, f"http://127.0.0.1:{port}/")
            turns[-1].append(figures.over(seconds))
            told, watched = asyncio.run(_watched(port, seconds, figures))
            turns[-1].append(watched)
            rates += told
            programs.end(node)
    return [
        ("first picture", f"{first:.1f} s", "<= 2 s"),
        ("sent to a page, median, not compressed", f"{np.median(rates) / 1e3:.1f} kB/s", "<= 60 kB/s"),
        _compared("share of a core, web_page", "web_page", "%", turns, "<= 5 %"),
        _compared("share of a core, mapping", "mapping", "%", turns, "the same"),
        _compared("CPU time of mapping for each beam", _PER_BEAM, "ms", turns, "the same"),
        *(_compared(f"callback of {one}", one, "ms", turns, "the same") for one in _STAGES),
    ]


def _is_served(port: int) -> bool:
    try:
        urlopen(f"http://127.0.0.1:{port}/", timeout=5.0).close()
        return True
    except OSError:
        return False


def _compared(name: str, key: str, unit: str, rounds: List[List[Turn]], wanted: str) -> Row:
    """Return the medians of the turns, and the least, the median and the greatest ratio of the last to the first."""
    shown = [(word, [one[turn][key] for one in rounds]) for turn, word in enumerate(_TURNS) if key in rounds[0][turn]]
    medians = ", ".join(f"{word} {np.nanmedian(values):.2f} {unit}" for word, values in shown)
    least, middle, most = np.nanquantile(np.divide(shown[-1][1], shown[0][1]), [0.0, 0.5, 1.0])
    return name, f"{medians}; ratio {middle:.2f} ({least:.2f} to {most:.2f})", wanted


@contextmanager
def chromium() -> Iterator[Any]:
    """Yield a headless Chromium."""
    from selenium import webdriver
    from selenium.webdriver.chrome.options import Options
    from selenium.webdriver.chrome.service import Service

    options = Options()
    for option in ("--headless=new", "--no-sandbox", "--disable-dev-shm-usage", "--window-size=1400,860"):
        options.add_argument(option)
    with webdriver.Chrome(service=Service("/usr/bin/chromedriver"), options=options) as browser:
        yield browser


def first_picture(browser: Any, address: str) -> float:
    """Return the seconds until the page is whole in a browser that runs already."""
    start = time.monotonic()
    browser.get(address)
    while not browser.execute_script(f"return Boolean(window.page && {_DRAWN})"):
        time.sleep(0.02)
    return time.monotonic() - start


async def _watched(port: int, seconds: float, figures: "Figures") -> Tuple[List[float], Turn]:
    """Return what each of the pages got in a second, and the figures meanwhile."""
    loop = asyncio.get_event_loop()
    found = loop.run_in_executor(None, figures.over, seconds)
    rates = await asyncio.gather(*(_bytes(port, seconds) for _ in range(_PAGES)))
    return list(rates), await found


async def _bytes(port: int, seconds: float) -> float:
    page = await websocket_connect(f"ws://127.0.0.1:{port}/live", compression_options={})
    page.write_message(HELLO)
    end, total = time.monotonic() + seconds, 0
    while time.monotonic() < end:
        total += len(await page.read_message())
    page.close()
    return total / seconds


class Figures:
    """CPU times of processes, from the system, and processing times of stages, from /diagnostics."""

    def __init__(self) -> None:
        """Wait until the graph runs, and listen."""
        import rospy
        from diagnostic_msgs.msg import DiagnosticArray

        self._stages: Dict[str, Tuple[float, float]] = {}
        wait_for_graph()
        rospy.init_node("web_bench", anonymous=True, disable_signals=True)
        rospy.Subscriber("/diagnostics", DiagnosticArray, self._take, queue_size=100)

    def _take(self, message: object) -> None:
        for status in message.status:
            stage = status.name.rpartition(" ")[2]
            values = {pair.key: pair.value for pair in status.values}
            if stage in _STAGES and "processing time mean [ms]" in values:
                count = float(values[_STAGES[stage]])
                self._stages[stage] = count, count * float(values["processing time mean [ms]"])

    def over(self, seconds: float) -> Turn:
        """Return shares of a core [%] by node and callback times [ms] by stage over the next seconds."""
        stages, processor = dict(self._stages), _processor_seconds()
        time.sleep(seconds)
        used = {node: now - processor.get(node, 0.0) for node, now in _processor_seconds().items()}
        # A turn in which a stage did nothing tells nothing of it.
        counts = {stage: (count - stages[stage][0]) or np.nan for stage, (count, _) in self._stages.items()}
        return {
            **{node: 100.0 * one / seconds for node, one in used.items()},
            **{stage: (self._stages[stage][1] - stages[stage][1]) / counts[stage] for stage in counts},
            _PER_BEAM: 1e3 * used["mapping"] / counts["sonar_to_cloud"],
        }


def _processor_seconds() -> Dict[str, float]:
    """Return the CPU seconds of our nodes so far, by name."""
    found = held_below(os.getpid())
    return {node: found[node].cpu for node in ("mapping", "web_page") if node in found}
