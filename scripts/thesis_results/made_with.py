"""With what, and when, a section was computed."""

import datetime as dt
import platform
import subprocess
from pathlib import Path
from xml.etree import ElementTree as ET

import matplotlib as mpl
import numpy as np
import scipy as sp

ROOT = Path(__file__).resolve().parents[2]
_COMPUTING = ("src", "scripts", "nodes", "yaml", "worlds", "urdf")


def made_with(seconds: float) -> str:
    """Return the line that says so; `seconds`: CPU time of the section."""
    version = ET.parse(str(ROOT / "package.xml")).getroot().findtext("version")
    libraries = ", ".join(f"{library.__name__} {library.__version__}" for library in (np, sp, mpl))
    return (
        f"*Computed on {dt.date.today().isoformat()} with version {version} (commit {_commit()}), "
        f"Python {platform.python_version()}, {libraries}; {seconds:.0f} s of CPU time.*"
    )


def _commit() -> str:
    """Return the commit that is checked out, with a + where what computes differs from it."""
    try:
        changed = _git("status", "--porcelain", "--", *_COMPUTING)
        return _git("rev-parse", "--short=8", "HEAD") + ("+" if changed else "")
    except (OSError, subprocess.CalledProcessError):
        return "unknown"


def _git(*words: str) -> str:
    command = ["git", "-C", str(ROOT), *words]
    return subprocess.run(command, stdout=subprocess.PIPE, check=True, text=True).stdout.strip()
