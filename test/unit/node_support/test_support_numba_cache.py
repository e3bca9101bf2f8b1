"""Compiled loops are to be had where numba finds no folder, and where another version of the package compiled them."""

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
LOOP_OF_A_CLASS = """
from typing import NamedTuple
from node_support.numba_cache import compiled
class {name}(NamedTuple):
    range: float
@compiled()
def doubled(echo):
    return 2.0 * echo.range
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


def test_what_was_compiled_for_a_class_that_is_gone_is_compiled_anew(tmp_path):
    loops = tmp_path / "loops.py"
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(tmp_path), *sys.path]), "NUMBA_CACHE_DIR": ""}
    for name in ("Heard", "Echo"):
        loops.write_text(LOOP_OF_A_CLASS.format(name=name))
        program = f"from loops import doubled, {name}; print(doubled({name}(1.5)))"
        command = [sys.executable, "-B", "-c", program]
        assert subprocess.run(command, env=environment, stdout=subprocess.PIPE, check=True).stdout == b"3.0\n"
    assert list((tmp_path / "__pycache__").glob("loops.doubled*.nbi"))
