"""The page behind a thin link that is cut: demo.launch in real time, and Chromium at the far end of a virtual cable.

The cable carries no more than --kilobits in each direction. It is cut several times, unplugged or losing all, and what
changed meanwhile is followed until the page has it. A second page, without the cable, tells what there was to have.
With --thin-link thin_link sends rviz the map through the same cable. Needs root, ip and tc.
"""

import asyncio
import json
import signal
import sys
import tempfile
import time
from contextlib import suppress
from pathlib import Path
from typing import List, Tuple
from zlib import adler32

import numpy as np
from tornado.websocket import websocket_connect

from benchmarks import link
from benchmarks.cable import TOPSIDE, VEHICLE, Version, arrivals, cannot_be_laid, demo_behind, told, versions, wait_for
from benchmarks.harness import Row, benchmark_parser, print_table, say
from benchmarks.programs import free_port, study
from benchmarks.web import HELLO, chromium, first_picture

_GROWN = 60.0  # s of mapping before the page is opened
_CUTS = ("unplugged", True), ("all lost", False)
_CUT, _WHOLE = 25.0, 10.0  # s: how long nothing is carried, and until the page shall be whole again
_BETWEEN = 20.0  # s
_NEAR, _FAR = "--near", "--far"
_NOW, _TILE = "now", 1  # what is not a tile, and the kind of those that are
# Adler-32, as zlib has it, of every binary message, with its time.
_NOTE = """
const {connection} = page, read = connection.read;
window.noted = [];
connection.read = (data) => {
  const bytes = typeof data === 'string' ? [] : new Uint8Array(data);
  let a = 1, b = 0;
  for (const one of bytes) { a = (a + one) % 65521; b = (b + a) % 65521; }
  const key = bytes[0] === 1 ? new Int16Array(data.slice(4, 8)).join() : 'now';
  noted.push([Date.now() / 1000, key, b * 65536 + a]);
  read.call(connection, data);
};"""
Cut = Tuple[str, float, float]
"""Which kind it was, when it began and when it ended."""


def measured(seconds: float, kilobits: int, thin_link: bool) -> List[Row]:
    """Return the rows of so many seconds of mapping, and of the cuts after them."""
    with tempfile.TemporaryDirectory() as folder, demo_behind(kilobits, folder) as (cable, programs):
        made, came, first, seen = (Path(folder, name) for name in ("made", "came", "first", "seen"))
        port = free_port()
        programs.launch("web_page.launch", "host:=0.0.0.0", f"port:={port}")
        programs.start(*study("page_link"), _NEAR, port, made)
        wait_for(made)
        if thin_link:
            programs.launch("thin_link.launch")
            programs.start(*cable.far_end, *link.LISTENER, "thin/MLSM/Markers", seen, ROS_IP=TOPSIDE)
        say(f"the vehicle maps for {_GROWN:g} s before the page is opened")
        time.sleep(_GROWN)
        programs.start(*cable.far_end, *study("page_link"), _FAR, port, came, first)
        wait_for(came)
        say(f"the page is open: measuring for {seconds:g} s")
        before, begin = cable.sent_bytes, time.time()
        time.sleep(seconds)
        rate, cuts = (cable.sent_bytes - before) / (time.time() - begin), []
        for name, unplugged in _CUTS:
            say(f"{name} for {_CUT:g} s, then {_BETWEEN:g} s to become whole")
            cuts.append((name, *cable.cut(_CUT, unplugged)))
            time.sleep(_BETWEEN)
        found = versions(made), versions(came)
        return [
            ("first picture, whole, through the cable", f"{float(first.read_text()):.1f} s", ""),
            ("on the cable while mapping", f"{rate / 1e3:.1f} kB/s", f"<= {kilobits / 8:g} kB/s"),
            *_of_changes(*found, begin, begin + seconds),
            *(_of_cut(*found, cut) for cut in cuts),
        ]


def _of_changes(made: List[Version], came: List[Version], begin: float, end: float) -> List[Row]:
    numbers = [number for number, (at, key, _) in enumerate(made) if begin < at < end - _WHOLE and key != _NOW]
    seconds = arrivals(made, came, numbers) - np.array([made[number][0] for number in numbers])
    reports = np.diff([at for at, key, _ in came if key == _NOW and begin < at < end])
    return [
        (f"delay of {len(numbers)} changed tiles, median, 95 %, most", told(seconds), f"<= {_WHOLE:g} s"),
        ("between two reports of the position, most", f"{reports.max():.1f} s", "<= 1 s"),
    ]


def _of_cut(made: List[Version], came: List[Version], cut: Cut) -> Row:
    """Return after how long the page had all that changed while nothing was carried, and the position again."""
    name, began, ended = cut
    numbers = [number for number, (at, key, _) in enumerate(made) if began < at < ended and key != _NOW]
    position = min((at for at, key, _ in came if key == _NOW and at > ended), default=np.inf)
    whole = max([position, *arrivals(made, came, numbers)]) - ended
    words = f"position after {position - ended:.1f} s, whole with {len(numbers)} tiles after {whole:.1f} s"
    return f"{name} for {_CUT:g} s", words, f"<= {_WHOLE:g} s"


async def _near(port: str, path: str) -> None:
    """Write what a page without the cable gets to the file `path`, until the process is ended."""
    while True:
        try:
            page = await websocket_connect(f"ws://{VEHICLE}:{port}/live")
            break
        except OSError:
            await asyncio.sleep(0.2)
    page.write_message(HELLO)
    with open(path, "w") as file:
        while True:
            data = await page.read_message()
            is_tile = isinstance(data, bytes) and data[0] == _TILE
            key = ",".join(map(str, np.frombuffer(data[4:8], "<i2"))) if is_tile else _NOW
            print(json.dumps([time.time(), key, adler32(data) if is_tile else 0]), file=file, flush=True)


def _far(port: str, path: str, first: str) -> None:
    """Open the page in Chromium, and write what it gets to the file `path`, until the process is ended."""
    with chromium() as browser, open(path, "w") as file:
        Path(first).write_text(str(first_picture(browser, f"http://{VEHICLE}:{port}/")))
        browser.execute_script(_NOTE)
        while True:
            for one in browser.execute_script("return noted.splice(0)"):
                print(json.dumps(one), file=file, flush=True)
            time.sleep(0.5)


def main() -> None:
    """Print the table."""
    if sys.argv[1:2] == [_NEAR]:
        asyncio.run(_near(*sys.argv[2:]))
    if sys.argv[1:2] == [_FAR]:
        # Chromium has to end too.
        signal.signal(signal.SIGTERM, signal.default_int_handler)
        with suppress(KeyboardInterrupt):
            _far(*sys.argv[2:])
        return
    parser = benchmark_parser("page_link", __doc__)
    parser.add_argument("--seconds", type=float, default=60.0, help="how long to measure before the cable is cut")
    parser.add_argument("--kilobits", type=int, default=256, help="that the link carries in a second")
    parser.add_argument("--thin-link", action="store_true", help="send rviz the map through the same cable")
    options = parser.parse_args()
    if not cannot_be_laid("page_link"):
        print_table(measured(options.seconds, options.kilobits, options.thin_link))
