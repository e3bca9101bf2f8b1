"""Maps recordings on 1, 2 and 4 local workers and on a Dask scheduler with two, of which one is killed at last.

Each row says how long that took, over the time of one worker, and whether all files hold the same bytes.
"""

import os
import re
import subprocess
import sys
import tempfile
import threading
import time
from contextlib import contextmanager
from pathlib import Path
from typing import Callable, Dict, Iterator, List

from benchmarks.harness import benchmark_parser
from mlsm_manager.offline.each import INDEX, map_each, recordings_in

_AT_ONCE = (1, 2, 4)
# What tells how long it took.
_SECONDS = re.compile(rb'"(seconds|times_real_time)": [0-9.e-]+')
_UNLIKE = ("messages.txt", INDEX, "report.html")


@contextmanager
def _cluster(workers: int) -> Iterator[List["subprocess.Popen[bytes]"]]:
    """Start a scheduler and workers; gives their processes, the scheduler first."""
    port, programs = "8797", []
    scheduler = ["dask_scheduler", "--port", port, "--no-dashboard", "--host", "127.0.0.1"]
    worker = ["dask_worker", f"tcp://127.0.0.1:{port}", "--nthreads", "1", "--no-dashboard", "--no-nanny"]
    try:
        for words in (scheduler, *([worker] * workers)):
            command = [sys.executable, "-m", f"distributed.cli.{words[0]}", *words[1:]]
            programs.append(subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL))
        _wait_for(f"tcp://127.0.0.1:{port}", workers)
        yield programs
    finally:
        for program in programs:
            program.kill()
            program.wait()


def _wait_for(address: str, workers: int) -> None:
    from distributed import Client

    with Client(address, timeout=60) as client:
        client.wait_for_workers(workers, timeout=60)


def _bytes_of(folder: Path) -> Dict[str, bytes]:
    files = (one for one in folder.rglob("*") if one.is_file() and one.name not in _UNLIKE)
    return {str(one.relative_to(folder)): _SECONDS.sub(b"", one.read_bytes()) for one in files}


def _folder(scratch: Path, name: str) -> Path:
    return scratch / name.replace(" ", "_")


def _kill_at_work(worker: "subprocess.Popen[bytes]", out: Path) -> None:
    """Kill one of two workers when both have begun a recording, each in a folder of its own."""
    while worker.poll() is None and sum(one.is_dir() for one in out.glob("*")) < 2:
        time.sleep(0.1)
    worker.kill()


def print_rows(recordings: List[Path], scratch: Path) -> None:
    """Map all recordings in each way, and print a row for each."""
    first: Dict[str, bytes] = {}
    reference = 0.0

    def row(name: str, run: Callable[[Path], object]) -> None:
        nonlocal reference
        out, start = _folder(scratch, name), time.monotonic()
        run(out)
        seconds, found = time.monotonic() - start, _bytes_of(out)
        reference = reference or seconds
        first.update(found if not first else {})
        same = sum(found.get(file) == content for file, content in first.items())
        print(
            f"{name:32} {seconds / len(recordings):7.1f} {seconds / reference:6.2f} {same:5} of {len(first)}",
            flush=True,
        )

    print(f"{'workers':32} s a file  ratio  same bytes")
    for at_once in _AT_ONCE:
        row(f"{at_once} local", lambda out, number=at_once: map_each(recordings, out, [], at_once=number))
    with _cluster(2):
        row("scheduler with 2", lambda out: map_each(recordings, out, [], "tcp://127.0.0.1:8797"))
    with _cluster(2) as programs:
        name = "scheduler with 2, 1 killed"
        threading.Thread(target=_kill_at_work, args=(programs[-1], _folder(scratch, name)), daemon=True).start()
        row(name, lambda out: map_each(recordings, out, [], "tcp://127.0.0.1:8797"))


def main() -> None:
    """Print the table."""
    parser = benchmark_parser("workers", __doc__)
    parser.add_argument("recordings", type=Path, nargs="+", help="recordings, or folders of them")
    # scripts/bench keeps other studies on one core.
    os.sched_setaffinity(0, range(os.cpu_count() or 1))
    with tempfile.TemporaryDirectory() as scratch:
        print_rows(recordings_in(parser.parse_args().recordings), Path(scratch))
