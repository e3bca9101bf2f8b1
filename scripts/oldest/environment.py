"""Makes the Python 3.8 environment with the oldest versions that the package claims, under build/oldest, once."""

import glob
import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Iterator, Optional

ROOT = Path(__file__).resolve().parents[2]
HERE = Path(__file__).resolve().parent
ENVIRONMENT = ROOT / "build/oldest"
REQUIREMENTS = (HERE / "requirements.txt", ROOT / "scripts/requirements.txt")
HOW_TO_GET_ONE = "no Python 3.8 found: set PYTHON38, or install python3.8 (or one with pyenv)"


def find_python38() -> Optional[str]:
    """Return a Python 3.8 that runs: $PYTHON38, python3.8 on the PATH or one of pyenv's; None when there is none."""
    return next((python for python in _candidates() if _is_python38(python)), None)


def _candidates() -> Iterator[str]:
    yield os.environ.get("PYTHON38", "")
    yield shutil.which("python3.8") or ""
    pyenv = os.environ.get("PYENV_ROOT") or str(Path.home() / ".pyenv")
    yield from sorted(glob.glob(f"{pyenv}/versions/3.8.*/bin/python3.8"))


def _is_python38(python: str) -> bool:
    show = [python, "-c", "import sys, venv, ensurepip; print(*sys.version_info[:2])"]
    try:
        return subprocess.run(show, capture_output=True, text=True, check=False).stdout.split() == ["3", "8"]
    except OSError:
        return False


def make_environment(python: str) -> None:
    """Make the environment, unless it was made from the same requirements; raises CalledProcessError."""
    stamp = ENVIRONMENT / "requirements.installed"
    wanted = b"".join(path.read_bytes() for path in REQUIREMENTS)
    if stamp.is_file() and stamp.read_bytes() == wanted:
        return
    shutil.rmtree(str(ENVIRONMENT), ignore_errors=True)
    subprocess.run([python, "-m", "venv", str(ENVIRONMENT)], check=True)
    pip = [str(ENVIRONMENT / "bin/python"), "-m", "pip", "install", "-q", "--no-compile", "--disable-pip-version-check"]
    subprocess.run([*pip, "wheel"], check=True)
    subprocess.run([*pip, "-r", str(REQUIREMENTS[0])], check=True)
    (site_packages,) = ENVIRONMENT.glob("lib/python3.8/site-packages")
    (site_packages / "ros_modules.pth").write_text(f"import sys; sys.path.append({str(HERE)!r}); import ros_modules\n")
    stamp.write_bytes(wanted)


def main() -> int:
    """Make the environment; return the exit status."""
    python = find_python38()
    if python is None:
        print(HOW_TO_GET_ONE)
        return 1
    make_environment(python)
    return 0


if __name__ == "__main__":
    sys.exit(main())
