"""Runs a program of nodes/ inside the test's process, which has loaded numpy, ROS and the package already."""

import os
import runpy
import sys
from contextlib import redirect_stderr, redirect_stdout
from io import StringIO
from pathlib import Path
from subprocess import CompletedProcess

import pytest

ROOT = Path(__file__).resolve().parents[2]
BASIN = ROOT / "test/data/basin.bag"


def run_program(name, *arguments, **variables):
    """Return status, output and errors of a program; `variables` are added to its environment."""
    command = [str(ROOT / "nodes" / name), *map(str, arguments)]
    output, errors = StringIO(), StringIO()
    with pytest.MonkeyPatch.context() as patched, redirect_stdout(output), redirect_stderr(errors):
        patched.setattr(sys, "argv", command)
        patched.setattr(os, "environ", {**os.environ, **variables})
        status = _status(command[0])
    return CompletedProcess(command, status, output.getvalue(), errors.getvalue())


def _status(path):
    """Run the file as Python does; return the exit status."""
    try:
        runpy.run_path(path, run_name="__main__")
    except SystemExit as end:
        if isinstance(end.code, str):
            print(end.code, file=sys.stderr)
            return 1
        return end.code or 0
    return 0
