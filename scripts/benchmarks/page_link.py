"""The page behind a thin link that is cut: demo.launch in real time, and Chromium at the far end of a virtual cable.

The cable carries no more than 256 kbit/s in each direction. It is cut several times, unplugged or losing all, and what
changed meanwhile is followed until the page has it. A second page, without the cable, tells what there was to have.
With --thin-link thin_link sends rviz the map through the same cable. Needs root, ip and tc.
"""

import asyncio
import json
import os
import signal
import sys
import tempfile
import time
from contextlib import suppress
from pathlib import Path
from typing import List
from zlib import adler32

import numpy as np
from tornado.websocket import websocket_connect

from benchmarks import cable
from benchmarks.harness import Row, say
from benchmarks.link import LISTENER
from benchmarks.programs import free_port
from benchmarks.web import HELLO, chromium, first_picture

_GROWN = 60.0  # s of mapping before the page is opened
_CUTS = ("unplugged", True), ("all lost", False)
_CUT, _BETWEEN = 25.0, 20.0  # s: how long nothing is carried, and until the next cut
_READER = [sys.executable, "-m", "benchmarks.page_link"]
"""The command that writes what a page gets, "near" the node or behind the cable, "far" from it."""
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


def rows(seconds: float = 60.0, thin_link: bool = False) -> List[Row]:
    """Return the rows of so many seconds of mapping, and of the cuts after them. thin_link: it has the same cable."""
    with tempfile.TemporaryDirectory() as folder, cable.demo_behind(folder) as (wire, programs):
        made, came, first = (Path(folder, name) for name in ("made", "came", "first"))
        port = free_port()
        programs.launch("web_page.launch", "host:=0.0.0.0", f"port:={port}")
        programs.start(*_READER, "near", port, made)
        cable.wait_for(made)
        if thin_link:
            programs.launch("thin_link.launch")
            programs.start(*wire.far_end, *LISTENER, "thin/MLSM/Markers", os.devnull, ROS_IP=cable.TOPSIDE)
        say(f"the vehicle maps for {_GROWN:g} s before the page is opened")
        time.sleep(_GROWN)
        programs.start(*wire.far_end, *_READER, "far", port, came, first)
        cable.wait_for(came)
        say(f"the page is open: measuring for {seconds:g} s")
        before, begin = wire.sent_bytes, time.time()
        time.sleep(seconds)
        rate, cuts = (wire.sent_bytes - before) / (time.time() - begin), []
        for name, unplugged in _CUTS:
            say(f"{name} for {_CUT:g} s, then {_BETWEEN:g} s to become whole")
            cuts.append((name, *wire.cut(_CUT, unplugged)))
            time.sleep(_BETWEEN)
        found = cable.versions(made), cable.versions(came)
        reports = np.diff([at for at, key, _ in found[1] if key == _NOW and begin < at < begin + seconds])
        return [
            ("first picture, whole, through the cable", f"{float(first.read_text()):.1f} s", ""),
            ("on the cable while mapping", f"{rate / 1e3:.1f} kB/s", f"<= {cable.KILOBITS / 8:g} kB/s"),
            cable.delays(*found, _tiles(found[0], begin, begin + seconds - cable.WANTED))[0],
            ("between two reports of the position, most", f"{reports.max():.1f} s", "<= 1 s"),
            *(_of_cut(*found, *cut) for cut in cuts),
        ]


def _tiles(made: List[cable.Version], begin: float, end: float) -> List[int]:
    """Return the numbers of the tiles that were made between two times."""
    return [number for number, (at, key, _) in enumerate(made) if begin < at < end and key != _NOW]


def _of_cut(made: List[cable.Version], came: List[cable.Version], name: str, began: float, ended: float) -> Row:
    """Return after how long the page had all that changed while nothing was carried, and the position again."""
    numbers = _tiles(made, began, ended)
    position = min((at for at, key, _ in came if key == _NOW and at > ended), default=np.inf)
    whole = max([position, *cable.arrivals(made, came, numbers)]) - ended
    words = f"position after {position - ended:.1f} s, whole with {len(numbers)} tiles after {whole:.1f} s"
    return f"{name} for {_CUT:g} s", words, f"<= {cable.WANTED:g} s"


async def _near(port: str, path: str) -> None:
    """Write what a page without the cable gets to the file `path`, until the process is ended."""
    while True:
        try:
            page = await websocket_connect(f"ws://{cable.VEHICLE}:{port}/live")
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
        Path(first).write_text(str(first_picture(browser, f"http://{cable.VEHICLE}:{port}/")))
        browser.execute_script(_NOTE)
        while True:
            for one in browser.execute_script("return noted.splice(0)"):
                print(json.dumps(one), file=file, flush=True)
            time.sleep(0.5)


if __name__ == "__main__":
    # Chromium has to end too.
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    with suppress(KeyboardInterrupt):
        if sys.argv[1] == "near":
            asyncio.run(_near(*sys.argv[2:]))
        else:
            _far(*sys.argv[2:])
