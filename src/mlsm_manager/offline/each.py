"""Maps many recordings, each in a process of its own or on a Dask cluster, into one folder with an index."""

import json
import logging
import os
import platform
import signal
import subprocess
import sys
import time
from concurrent.futures import FIRST_COMPLETED, CancelledError, Future, ThreadPoolExecutor, wait
from itertools import chain, count
from pathlib import Path
from typing import Any, Callable, Dict, Iterable, List, Optional, Sequence, Tuple

import numpy as np
import scipy

from mlsm_manager.offline.index_page import Outcome, index_page
from node_support.errors import needed
from node_support.files import make_folder, write_whole
from recordings.bags.bag import RecordingError
from recordings.bags.ros2_folder import METADATA, STORAGES
from recordings.makers_logs import is_makers_log

TIMEOUT = 10.0  # s: a cluster in the same network answers within a second, a busy one within a few
PATIENCE = 30.0  # s without any worker after which none is expected to come back: one started anew needs a few
_WORKER = "python3 -m distributed.cli.dask_worker ADDRESS"
_LOGS = ("distributed.client", "distributed.utils", "asyncio")


class Cluster:
    """The running cluster at an address; a context manager. Workers that are lost cost the time of their jobs only."""

    def __init__(self, address: str, folder: Path) -> None:
        """`folder`: where the workers will write. Raises RecordingError for what would stop the jobs later."""
        distributed = needed("distributed", "apt install python3-distributed", RecordingError)
        self._address, self._seen = address, time.monotonic()
        # A lost scheduler is told in one line; Dask's threads would add pages.
        for name in _LOGS:
            logging.getLogger(name).setLevel(logging.CRITICAL + 1)
        try:
            self._client = distributed.Client(address, timeout=TIMEOUT)
        except (OSError, ValueError) as error:
            raise RecordingError(f"--scheduler {address}: {error or 'cannot be reached'}") from None
        try:
            self._check_workers(folder.absolute())
        except BaseException:
            self._client.close()
            raise
        self._executor = self._client.get_executor(pure=False)

    def __enter__(self) -> "Cluster":
        return self

    def __exit__(self, *exception: object) -> None:
        try:
            self._executor.shutdown(wait=False)
            self._client.close()
        except (OSError, CancelledError, AttributeError):
            pass  # the scheduler is lost; while Dask connects to it again, it calls one that it does not have

    def submit(self, function: Callable[..., Any], *arguments: Any) -> "Future[Any]":
        """Run a function of a module, by its name, on any worker."""
        return self._executor.submit(function, *arguments)

    def check(self, kept: str) -> None:
        """Raise RecordingError, which says what is `kept`, where no worker has been there for long."""
        try:
            running = self._client.status == "running"
            has_workers = running and bool(self._client.scheduler_info()["workers"])
        except (OSError, CancelledError):
            running, has_workers = False, False
        if has_workers:
            self._seen = time.monotonic()
        elif not running or time.monotonic() - self._seen > PATIENCE:
            lost = "all workers are lost" if running else "the scheduler is lost"
            raise RecordingError(
                f"--scheduler {self._address}: {lost}; {kept}, and the same command goes on from there"
            )

    def _check_workers(self, folder: Path) -> None:
        """Raise RecordingError without a worker, and for one that lacks packages or does not see a folder."""
        if not self._client.scheduler_info()["workers"]:
            raise RecordingError(f"--scheduler {self._address}: it has no worker; start one with: {_WORKER}")
        try:
            found: Dict[str, Tuple[Dict[str, str], bool]] = self._client.run(_look, folder)
        except Exception as error:  # whatever the import of our packages leads to on a worker
            raise RecordingError(
                f"--scheduler {self._address}: a worker cannot run map_bag: {error}; start workers with the "
                f"Python that runs it here: {_WORKER}"
            ) from None
        here, _ = _look(folder)
        for worker, (versions, is_there) in found.items():
            if versions != here:
                raise RecordingError(f"--scheduler {self._address}: {worker} has {versions}, here are {here}")
            if not is_there:
                raise RecordingError(f"--scheduler {self._address}: {worker} does not see {folder}")


def _look(folder: Path) -> Tuple[Dict[str, str], bool]:
    """Return the versions on which the bytes of a map depend, and whether a folder is seen."""
    versions = {"python": platform.python_version(), "numpy": np.__version__, "scipy": scipy.__version__}
    return versions, folder.is_dir()


INDEX = "index.html"
_SUFFIXES = (".bag", ".active", *STORAGES)  # .bag.active: of a recording that was cut off
_MESSAGES = "messages.txt"
_SUMMARY = "summary.json"
_PROGRAM = "from mlsm_manager.offline.program import main; main()"
_PREFIX = "map_bag: "  # of a line that says why there is no map
_LOOK = 2.0  # s after which one looks whether workers are left


def recordings_in(paths: Iterable[Path]) -> List[Path]:
    """Return the recordings among files, and in folders at any depth. Raises RecordingError where there is none."""
    found: List[Path] = []
    for path in paths:
        if path.is_dir() and not (path / METADATA).is_file():
            found += sorted(one for one in path.rglob("*") if _is_recording(one))
        else:
            found.append(path)
    unique = list(dict.fromkeys(found))
    if not unique:
        raise RecordingError(f"no recording in {', '.join(map(str, paths))}")
    return unique


def _is_recording(path: Path) -> bool:
    if path.is_dir():
        return (path / METADATA).is_file()
    in_folder = (path.parent / METADATA).is_file()
    return path.is_file() and not in_folder and (path.suffix.lower() in _SUFFIXES or is_makers_log(path))


def options_of_one(arguments: Sequence[str], recordings: Sequence[Path]) -> List[str]:
    """Return the command line without the recordings, --each, --out and --scheduler: what is said of each of them."""
    words, kept = iter(arguments), []
    for word in words:
        if word in ("--out", "--scheduler"):
            next(words, None)
        elif word != "--each" and not word.startswith(("--out=", "--scheduler=")) and Path(word) not in recordings:
            kept.append(word)
    return kept


def map_each(
    recordings: Sequence[Path], out: Path, options: Sequence[str], scheduler: Optional[str] = None,
    at_once: Optional[int] = None,
) -> List[Outcome]:  # fmt: skip
    """Map each recording as `map_bag RECORDING --out FOLDER` with `options` does; what is there stays.

    They run `at_once`, by default as many as there are cores, or on the Dask cluster at the address `scheduler`, whose
    workers see the same folders. The index is written anew after each of them. Raises OSError where `out` cannot be
    written, and RecordingError where the cluster cannot be used, or is lost.
    """
    make_folder(out)
    jobs = _jobs(recordings, out)
    outcomes: Dict[Tuple[Path, Path], Outcome] = {}
    with ThreadPoolExecutor(at_once or os.cpu_count()) if scheduler is None else Cluster(scheduler, out) as workers:
        running = {workers.submit(_mapped, *job, options) for job in jobs}
        try:
            while running:
                done, running = wait(running, _LOOK, FIRST_COMPLETED)
                if isinstance(workers, Cluster) and (not done or any(one.cancelled() for one in done)):
                    workers.check(f"{len(outcomes)} of {len(jobs)} recordings are done and stay")
                for one in done:
                    outcome = one.result()
                    outcomes[outcome[:2]] = outcome
                    line = f"{len(outcomes)}/{len(jobs)} {outcome.recording}: {outcome.problem or 'mapped'}"
                    print(line, flush=True)
                    page = index_page([outcomes[job] for job in jobs if job in outcomes], len(jobs))
                    write_whole(out / INDEX, page.encode())
        except BaseException:
            for one in running:
                one.cancel()
            raise
    return [outcomes[job] for job in jobs]


def _jobs(recordings: Sequence[Path], out: Path) -> List[Tuple[Path, Path]]:
    """Return each recording with the folder of its map, of its own name; where that is taken, with a number behind."""
    folders: Dict[str, Path] = {}
    for recording in recordings:
        numbered = (f"{recording.stem}_{number}" for number in count(2))
        folders[next(name for name in chain([recording.stem], numbered) if name not in folders)] = recording
    return [(recording.absolute(), out.absolute() / name) for name, recording in folders.items()]


def _mapped(recording: Path, folder: Path, options: Sequence[str]) -> Outcome:
    """Run map_bag for one recording, unless its map is there; its messages stand in its folder."""
    if not all((folder / name).is_file() for name in (_SUMMARY, _MESSAGES)):
        make_folder(folder)
        words = [sys.executable, "-c", _PROGRAM, str(recording), "--out", str(folder), *options]
        found = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
        done = subprocess.run(words, env=found, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, check=False)
        if done.returncode:
            return Outcome(recording, folder, {}, _problem(done))
        # Last, for a folder without it is mapped anew.
        write_whole(folder / _MESSAGES, done.stdout)
    return Outcome(recording, folder, json.loads((folder / _SUMMARY).read_text()), "")


def _problem(done: "subprocess.CompletedProcess[bytes]") -> str:
    if done.returncode < 0:
        return f"ended by {signal.Signals(-done.returncode).name}"
    lines = done.stdout.decode(errors="replace").strip().splitlines()
    if not lines:
        return f"ended with status {done.returncode}"
    return lines[-1][len(_PREFIX) :] if lines[-1].startswith(_PREFIX) else lines[-1]
