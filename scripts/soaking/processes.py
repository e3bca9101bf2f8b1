"""What processes hold, as the kernel tells it."""

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Dict, List

_PAGE = os.sysconf("SC_PAGE_SIZE")


@dataclass(frozen=True)
class Held:
    """What a process holds at one time. memory: MB in RAM. files: open ones, sockets too. cpu: s, so far."""

    memory: float
    files: int
    threads: int
    cpu: float


def held_below(pid: int) -> Dict[str, Held]:
    """Return what each descendant of a process holds, by its name in ROS or that of its program."""
    found = {}
    for child in _descendants(pid):
        try:
            found[_name(child)] = held(child)
        except (FileNotFoundError, ProcessLookupError):
            continue  # it has just ended
    return found


def _descendants(pid: int) -> List[int]:
    parents: Dict[int, List[int]] = {}
    for entry in Path("/proc").glob("[0-9]*"):
        try:
            parents.setdefault(int(_stat(int(entry.name))[1]), []).append(int(entry.name))
        except (FileNotFoundError, ProcessLookupError):
            continue
    found = [pid]
    for one in found:
        found += parents.get(one, [])
    return found[1:]


def _stat(pid: int) -> List[str]:
    """Return the fields of /proc/PID/stat from the third on: state, parent, ..."""
    return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()


def _name(pid: int) -> str:
    words = Path(f"/proc/{pid}/cmdline").read_bytes().decode(errors="replace").split("\0")
    names = [word.partition(":=")[2] for word in words if word.startswith("__name:=")]
    programs = [Path(word).name for word in words if word and not Path(word).name.startswith("python")]
    return (names or programs or [str(pid)])[0]


def held(pid: int) -> Held:
    """Return what a process holds now."""
    fields = _stat(pid)
    resident = int(Path(f"/proc/{pid}/statm").read_text().split()[1])
    ticks = int(fields[11]) + int(fields[12])
    files = len(list(Path(f"/proc/{pid}/fd").iterdir()))
    return Held(resident * _PAGE / 1e6, files, int(fields[17]), ticks / os.sysconf("SC_CLK_TCK"))
