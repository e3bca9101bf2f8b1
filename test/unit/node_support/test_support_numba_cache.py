"""Compiled loops are to be had where numba finds no folder for what it compiles."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from node_support import numba_cache

pytest.importorskip("numba")
LOADED = """
import logging, sys
logging.basicConfig(stream=sys.stdout, format="%(message)s")
from node_support.numba_cache import has_cache, prepare_cache
"""


def _output(program, folder, **environment):
    """Run a program with a copy of node_support in `folder` whose folder for compiled files is a file."""
    package = folder / "node_support"
    shutil.copytree(str(Path(numba_cache.__file__).parent), str(package), ignore=shutil.ignore_patterns("__pycache__"))
    (package / "__pycache__").write_text("")
    no_folder = str(package / "__pycache__" / "none")
    variables = {**os.environ, "PYTHONPATH": str(folder), "XDG_CACHE_HOME": no_folder, **environment}
    done = subprocess.run([sys.executable, "-c", LOADED + program], env=variables, stdout=subprocess.PIPE, check=True)
    return done.stdout.decode().splitlines()


def test_without_a_folder_loops_are_compiled_into_a_temporary_one_and_one_line_says_what_to_do(tmp_path):
    loops = """
from node_support.numba_cache import compiled
@compiled()
def one():
    return 1
@compiled("i8()")
def two():
    return 2
"""
    (tmp_path / "loops.py").write_text(loops)
    program = """
from loops import one, two
from numba import config
print(one() + two(), has_cache(), config.CACHE_DIR)
"""
    warning, result = _output(program, tmp_path, TMPDIR=str(tmp_path))
    assert "set NUMBA_CACHE_DIR to a folder that can be written to" in warning
    three, has_cache, folder = result.split()
    assert (three, has_cache) == ("3", "False")
    assert Path(folder).parent == tmp_path
    assert not Path(folder).exists()


def test_a_folder_named_by_the_user_is_enough(tmp_path):
    cache = tmp_path / "cache"
    cache.mkdir()
    assert _output("prepare_cache(); print(has_cache())", tmp_path, NUMBA_CACHE_DIR=str(cache)) == ["True"]
