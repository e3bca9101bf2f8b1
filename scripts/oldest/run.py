"""Runs the unit tests with the oldest versions that the package claims, in an environment kept under build/oldest.

Arguments go to pytest: python3 scripts/oldest/run.py test/unit/mlsm_manager
"""

import glob
import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Iterator, List, Optional

ROOT = Path(__file__).resolve().parents[2]
HERE = Path(__file__).resolve().parent
ENVIRONMENT = ROOT / "build/oldest"
REQUIREMENTS = HERE / "requirements.txt"
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
    if stamp.is_file() and stamp.read_bytes() == REQUIREMENTS.read_bytes():
        return
    shutil.rmtree(str(ENVIRONMENT), ignore_errors=True)
    subprocess.run([python, "-m", "venv", str(ENVIRONMENT)], check=True)
    pip = [str(ENVIRONMENT / "bin/python"), "-m", "pip", "install", "--quiet", "--disable-pip-version-check"]
    subprocess.run([*pip, "wheel"], check=True)
    subprocess.run([*pip, "-r", str(REQUIREMENTS)], check=True)
    (site_packages,) = ENVIRONMENT.glob("lib/python3.8/site-packages")
    (site_packages / "ros_modules.pth").write_text(f"import sys; sys.path.append({str(HERE)!r}); import ros_modules\n")
    shutil.copy(str(REQUIREMENTS), str(stamp))


def environment() -> dict:
    """Return the variables for processes of the environment: our sources, and where ROS's modules lie.

    PYTHONPATH keeps what it has: ROS's own tools, which tests start, run with the Python that ROS was built for.
    """
    ours = [str(ROOT / "src"), str(ROOT / "scripts"), str(HERE)]
    before = os.environ.get("PYTHONPATH", "").split(os.pathsep)
    return {
        **os.environ,
        "PYTHONPATH": os.pathsep.join([*ours, *filter(None, before)]),
        "ROS_PYTHON_FOLDERS": os.pathsep.join(_ros_folders()),
    }


def _ros_folders() -> List[str]:
    """Return the module folders of the Python that runs this, which env.bash made the one with ROS."""
    return [folder for folder in sys.path if folder.endswith("-packages") and "/venv/" not in folder]


def main(arguments: List[str]) -> int:
    """Make the environment and run pytest in it; return its exit status."""
    python = find_python38()
    if python is None:
        print(HOW_TO_GET_ONE)
        return 1
    make_environment(python)
    pytest = [str(ENVIRONMENT / "bin/python"), "-m", "pytest", "-p", "skip_compiled", "--hypothesis-profile=few"]
    return subprocess.run([*pytest, *arguments], cwd=str(ROOT), env=environment(), check=False).returncode


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
