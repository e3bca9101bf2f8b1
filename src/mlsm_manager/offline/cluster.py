"""A Dask cluster that runs jobs: checked before the first, and watched while they run."""

import logging
import platform
import time
from concurrent.futures import CancelledError, Future
from pathlib import Path
from typing import Any, Callable, Dict, Tuple

import numpy as np
import scipy

from recordings.bags.bag import RecordingError

TIMEOUT = 10.0
"""s: a cluster in the same network answers within a second, a busy one within a few."""
PATIENCE = 30.0
"""s without any worker after which none is expected to come back: a worker that is started anew needs a few."""
_LOGS = ("distributed.client", "distributed.utils", "asyncio")


class Cluster:
    """The running cluster at an address; a context manager. Workers that are lost cost the time of their jobs only."""

    def __init__(self, address: str, folder: Path) -> None:
        """`folder`: where the workers will write. Raises RecordingError for what would stop the jobs later."""
        try:
            from distributed import Client
        except ImportError:
            raise RecordingError("--scheduler needs Dask; install it with: apt install python3-distributed") from None
        self._address, self._seen = address, time.monotonic()
        # A lost scheduler is told in one line; Dask's threads would add pages.
        for name in _LOGS:
            logging.getLogger(name).setLevel(logging.CRITICAL + 1)
        try:
            self._client = Client(address, timeout=TIMEOUT)
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
        except (OSError, CancelledError):
            pass  # the scheduler is lost

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
            raise RecordingError(f"--scheduler {self._address}: it has no worker; start one with: dask-worker ADDRESS")
        try:
            found: Dict[str, Tuple[Dict[str, str], bool]] = self._client.run(_look, folder)
        except Exception as error:  # whatever the import of our packages leads to on a worker
            raise RecordingError(
                f"--scheduler {self._address}: a worker cannot run map_bag: {error}; start workers with the "
                "Python that runs it here: python3 -m distributed.cli.dask_worker ADDRESS"
            ) from None
        for worker, (versions, is_there) in found.items():
            if versions != _versions():
                raise RecordingError(f"--scheduler {self._address}: {worker} has {versions}, here are {_versions()}")
            if not is_there:
                raise RecordingError(f"--scheduler {self._address}: {worker} does not see {folder}")


def _versions() -> Dict[str, str]:
    """Return the versions on which the bytes of a map depend."""
    return {"python": platform.python_version(), "numpy": np.__version__, "scipy": scipy.__version__}


def _look(folder: Path) -> Tuple[Dict[str, str], bool]:
    """Return what a worker has, and whether it sees a folder."""
    return _versions(), folder.is_dir()
