"""A program on a damaged file, in a process of its own that may not take much of anything."""

import os
import resource
import shutil
import signal
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Callable, Dict, Iterator, List, Sequence

from soaking.processes import held

from fuzz_files.samples import FILE, OUT, Sample
from mlsm_manager.map_tool import run_map_tool
from mlsm_manager.migrate_yaml import run_migrate_yaml
from mlsm_manager.offline.map_bag import run_map_bag
from recordings.convert_bag import run_convert_bag
from sonar_simulator.simulation.simulate_bag import run_simulate_bag

PROGRAMS: Dict[str, Callable[[], None]] = {
    "convert_bag": run_convert_bag, "map_bag": run_map_bag, "map_tool": run_map_tool,
    "migrate_yaml": run_migrate_yaml, "simulate_bag": run_simulate_bag,
}  # fmt: skip
MOST_BYTES = 300e6
"""That a program may take beside what it took to start; where ten times the file is more, that."""
_LIMIT = 3_000_000_000  # Bytes of addresses: what takes more is ended before it hurts the machine
_PATIENCE = 60.0  # s of processor time
_INTERRUPTED_AFTER, _ENDLESS_AFTER = 300.0, 3.0  # s


@dataclass(frozen=True)
class Run:
    """How a program ended. status: of its exit. lines: of its standard error. grown: bytes, seconds: CPU."""

    status: int
    lines: List[str]
    grown: float
    seconds: float
    written: List[str]

    @property
    def was_interrupted(self) -> bool:
        """Whether it took too long."""
        return bool(self.lines) and self.lines[-1].endswith(": interrupted")

    def complaints(self, size: int, program: str) -> Iterator[str]:
        """Yield in words what a user should not see; size: of the file, bytes."""
        text = "\n".join(self.lines)
        if "Traceback" in text or self.status < 0:
            yield f"status {self.status}: {self.lines[-1] if self.lines else 'nothing said'}"
        elif self.status and not any(line.startswith(f"{program}: ") for line in self.lines[-1:]):
            yield f"status {self.status}, last line: {self.lines[-1] if self.lines else 'none'}"
        elif any("Warning" in line for line in self.lines):
            yield next(line for line in self.lines if "Warning" in line)
        if self.status and self.written:
            yield f"status {self.status}, but wrote {', '.join(self.written)}"
        if self.grown > max(MOST_BYTES, 10.0 * size):
            yield f"{self.grown / 1e6:.0f} MB more memory for a file of {size} bytes"
        if self.seconds > _PATIENCE:
            yield f"{self.seconds:.0f} s"


def run(sample: Sample, command: Sequence[str], path: Path, folder: Path) -> Run:
    """Run a command on the damaged file at `path`; `folder` is made anew and keeps what was written."""
    shutil.rmtree(str(folder), ignore_errors=True)
    folder.mkdir()
    said, out = folder / "stderr.txt", folder / "out"
    out.mkdir()
    before = 1e6 * held(os.getpid()).memory
    child = os.fork()
    if child == 0:
        _child(sample, [word.replace(FILE, str(path)).replace(OUT, str(out)) for word in command], said)
    _, status, usage = os.wait4(child, 0)
    code = -os.WTERMSIG(status) if os.WIFSIGNALED(status) else os.WEXITSTATUS(status)
    return Run(
        code, said.read_text(errors="replace").splitlines(), 1024.0 * usage.ru_maxrss - before,
        usage.ru_utime + usage.ru_stime, sorted(str(one.relative_to(out)) for one in out.rglob("*")),
    )  # fmt: skip


def _child(sample: Sample, command: List[str], said: Path) -> None:
    """Run a program as its file in nodes/ does, and leave."""
    os.dup2(os.open(str(said), os.O_WRONLY | os.O_CREAT), 2)
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
    tempfile.tempdir = str(said.parent)  # who is ended leaves what it has there
    resource.setrlimit(resource.RLIMIT_AS, (_LIMIT, _LIMIT))
    signal.setitimer(signal.ITIMER_REAL, _ENDLESS_AFTER if sample.may_be_endless else _INTERRUPTED_AFTER)
    signal.signal(signal.SIGALRM, signal.default_int_handler)
    sys.argv = command
    status = 1
    try:
        PROGRAMS[command[0]]()
        status = 0
    except SystemExit as end:
        if isinstance(end.code, str):
            print(end.code, file=sys.stderr)
        status = 1 if isinstance(end.code, str) else end.code or 0
    except BaseException:
        sys.excepthook(*sys.exc_info())
    finally:
        sys.stderr.flush()
        os._exit(status)
