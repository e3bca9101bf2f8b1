"""A Python environment without ROS under build/plain, with what pyproject.toml asks for and nothing else."""

import glob
import os
import shutil
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
ENVIRONMENT = ROOT / "build/plain"
_FONTS = ENVIRONMENT / "matplotlib"  # its list of fonts, made once: making it anew in each home takes seconds
_SOURCES = ("migration", "nodes", "src", "urdf", "web", "worlds", "yaml")
_DESCRIPTIONS = ("README.md", "LICENSE", "package.xml", "pyproject.toml", "setup.py")


def newest_python() -> str:
    """Return $PLAIN_PYTHON, or the newest Python from 3.9 to 3.12 of pyenv, or the one that runs this."""
    versions = os.environ.get("PYENV_ROOT") or str(Path.home() / ".pyenv")
    found = [path for minor in (12, 11, 10, 9) for path in glob.glob(f"{versions}/versions/3.{minor}.*/bin/python3")]
    return os.environ.get("PLAIN_PYTHON") or next(iter(found), os.path.realpath(sys.executable))


def install(copy: Path) -> None:
    """Install the checkout from `copy`, a folder to be made; what it depends on is downloaded the first time only."""
    _copy_sources(copy)
    stamp = ENVIRONMENT / "pyproject.installed"
    wanted = (ROOT / "pyproject.toml").read_bytes() + newest_python().encode()
    if not stamp.is_file() or stamp.read_bytes() != wanted:
        shutil.rmtree(str(ENVIRONMENT), ignore_errors=True)
        subprocess.run([newest_python(), "-m", "venv", str(ENVIRONMENT)], check=True)
        _pip("setuptools>=61", "wheel")
        _pip(str(copy))
        stamp.write_bytes(wanted)
    else:
        _pip("--no-deps", "--no-build-isolation", "--no-index", "--force-reinstall", str(copy))
    run("python", "-c", "import matplotlib.font_manager", folder=copy)


def run(*command: object, folder: Path) -> str:
    """Run a program of the environment in `folder`, with nothing of this shell; return its output, fail with it."""
    program, *arguments = map(str, command)
    paths = os.pathsep.join([str(ENVIRONMENT / "bin"), "/usr/bin", "/bin"])
    environment = {"HOME": str(folder), "PATH": paths, "MPLCONFIGDIR": str(_FONTS)}
    done = subprocess.run(
        [str(ENVIRONMENT / "bin" / program), *arguments], env=environment, cwd=str(folder), stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT, text=True, timeout=600, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout
    return done.stdout


def _copy_sources(copy: Path) -> None:
    """Copy, because pip leaves what it builds in the folder."""
    for name in _SOURCES:
        shutil.copytree(str(ROOT / name), str(copy / name), ignore=shutil.ignore_patterns("__pycache__", "*.egg-info"))
    for name in _DESCRIPTIONS:
        shutil.copy(str(ROOT / name), str(copy / name))


def _pip(*arguments: str) -> None:
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    pip = [str(ENVIRONMENT / "bin/python"), "-m", "pip", "--disable-pip-version-check"]
    subprocess.run([*pip, "install", "--quiet", "--no-compile", *arguments], env=environment, check=True)
