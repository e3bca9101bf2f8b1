"""Compiled loops are to be had where numba finds no folder for what it compiles."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

from node_support import numba_cache

LOOPS = """
from node_support.numba_cache import compiled
@compiled()
def one():
    return 1
@compiled("i8()")
def two():
    return 2
"""
PROGRAM = """
import logging, sys
logging.basicConfig(stream=sys.stdout, format="%(message)s")
from loops import one, two
from numba import config
print(one() + two(), config.CACHE_DIR)
"""


def _output(folder, **environment):
    """Run a program with loops in `folder`, whose own folder for compiled files is a file."""
    package = folder / "node_support"
    package.mkdir()
    shutil.copy(numba_cache.__file__, str(package))
    for name in (package, folder):
        (name / "__pycache__").write_text("")
    (folder / "loops.py").write_text(LOOPS)
    no_folder = str(folder / "__pycache__" / "none")
    variables = {**os.environ, "PYTHONPATH": str(folder), "XDG_CACHE_HOME": no_folder, **environment}
    done = subprocess.run([sys.executable, "-c", PROGRAM], env=variables, stdout=subprocess.PIPE, check=True)
    return done.stdout.decode().splitlines()


def test_without_a_folder_loops_are_compiled_into_a_temporary_one_and_one_line_says_what_to_do(tmp_path):
    warning, result = _output(tmp_path, TMPDIR=str(tmp_path))
    assert "set NUMBA_CACHE_DIR to a folder that can be written to" in warning
    three, folder = result.split()
    assert three == "3"
    assert Path(folder).parent == tmp_path
    assert not Path(folder).exists()


def test_a_folder_named_by_the_user_is_enough(tmp_path):
    cache = tmp_path / "cache"
    cache.mkdir()
    assert _output(tmp_path, NUMBA_CACHE_DIR=str(cache)) == [f"3 {cache}"]
    assert list(cache.rglob("*.nbi"))
