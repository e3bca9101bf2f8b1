"""Recordings mapped on 1, 2 and 4 local workers and on a Dask scheduler with two, of which one is killed at last.

Each row says how long that took, over the time of one worker, and whether all files hold the same bytes.
"""

import os
import re
import subprocess
import sys
import tempfile
import threading
import time
from contextlib import contextmanager, nullcontext
from pathlib import Path
from typing import Dict, Iterator, List

from mlsm_manager.offline.each import INDEX, map_each, recordings_in

_ADDRESS = "tcp://127.0.0.1:8797"
_WAYS = {"1 local": 1, "2 local": 2, "4 local": 4, "scheduler with 2": None, "scheduler with 2, 1 killed": None}
"""How many local workers there are, None on a scheduler."""
# What tells how long it took.
_SECONDS = re.compile(rb'"(seconds|times_real_time)": [0-9.e-]+')
_UNLIKE = ("messages.txt", INDEX, "report.html")


@contextmanager
def _cluster(workers: int) -> Iterator[List["subprocess.Popen[bytes]"]]:
    """Start a scheduler and workers; gives their processes, the scheduler first."""
    from distributed import Client

    programs = []
    scheduler = ["dask_scheduler", "--port", _ADDRESS.rpartition(":")[2], "--no-dashboard", "--host", "127.0.0.1"]
    worker = ["dask_worker", _ADDRESS, "--nthreads", "1", "--no-dashboard", "--no-nanny"]
    try:
        for words in (scheduler, *([worker] * workers)):
            command = [sys.executable, "-m", f"distributed.cli.{words[0]}", *words[1:]]
            programs.append(subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL))
        with Client(_ADDRESS, timeout=60) as client:
            client.wait_for_workers(workers, timeout=60)
        yield programs
    finally:
        for program in programs:
            program.kill()
            program.wait()


def _kill_at_work(worker: "subprocess.Popen[bytes]", out: Path) -> None:
    """Kill one of two workers when both have begun a recording, each in a folder of its own."""
    while worker.poll() is None and sum(one.is_dir() for one in out.glob("*")) < 2:
        time.sleep(0.1)
    worker.kill()


def lines(recordings: List[Path]) -> Iterator[str]:
    """Yield a row for each way."""
    # scripts/bench keeps other benches on one core.
    os.sched_setaffinity(0, range(os.cpu_count() or 1))
    paths = recordings_in(recordings)
    first: Dict[str, bytes] = {}
    reference = 0.0
    yield f"{'workers':32} s a file  ratio  same bytes"
    with tempfile.TemporaryDirectory() as scratch:
        for name, at_once in _WAYS.items():
            out, scheduler = Path(scratch) / name.replace(" ", "_"), None if at_once else _ADDRESS
            with nullcontext() if at_once else _cluster(2) as programs:
                if name.endswith("killed"):
                    threading.Thread(target=_kill_at_work, args=(programs[-1], out), daemon=True).start()
                start = time.monotonic()
                map_each(paths, out, [], scheduler, at_once)
                seconds = time.monotonic() - start
            files = (one for one in out.rglob("*") if one.is_file() and one.name not in _UNLIKE)
            found = {str(one.relative_to(out)): _SECONDS.sub(b"", one.read_bytes()) for one in files}
            reference, first = reference or seconds, first or found
            same = sum(found.get(file) == content for file, content in first.items())
            yield f"{name:32} {seconds / len(paths):7.1f} {seconds / reference:6.2f} {same:5} of {len(first)}"
