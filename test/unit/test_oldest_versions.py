"""The run with the oldest versions: which Python it takes, and which modules of ROS are lent to that one."""

import pytest
from oldest.environment import find_python38
from oldest.ros_modules import CompiledModuleError, RosModules


def _program(path, text):
    path.write_text(f"#!/bin/sh\n{text}\n")
    path.chmod(0o755)
    return str(path)


@pytest.fixture
def no_python(tmp_path, monkeypatch):
    monkeypatch.setenv("PATH", str(tmp_path / "nothing"))
    monkeypatch.setenv("PYENV_ROOT", str(tmp_path / "pyenv"))
    monkeypatch.delenv("PYTHON38", raising=False)


@pytest.fixture
def folder(tmp_path):
    for name in ("pure", "compiled"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "__init__.py").write_text("")
    (tmp_path / "compiled" / "_part.cpython-311-x86_64-linux-gnu.so").write_bytes(b"")
    return tmp_path


@pytest.mark.parametrize(("text", "taken"), [("echo 3 8", True), ("echo 3 9", False), ("exit 127", False)])
def test_the_named_python_is_taken_if_it_runs_and_is_the_right_one(no_python, tmp_path, monkeypatch, text, taken):
    named = _program(tmp_path / "named", text)
    monkeypatch.setenv("PYTHON38", named)
    assert find_python38() == (named if taken else None)


def test_one_of_pyenv_is_found(no_python, tmp_path):
    binaries = tmp_path / "pyenv/versions/3.8.18/bin"
    binaries.mkdir(parents=True)
    assert find_python38() is None
    python = _program(binaries / "python3.8", "echo 3 8")
    assert find_python38() == python


def test_a_pure_module_is_lent_and_what_no_folder_has_stays_missing(folder):
    assert RosModules([str(folder)]).find_spec("pure").origin == str(folder / "pure/__init__.py")
    assert RosModules([str(folder)]).find_spec("absent") is None


def test_a_compiled_module_is_refused_by_its_name(folder):
    with pytest.raises(CompiledModuleError, match="compiled is compiled for another Python"):
        RosModules([str(folder)]).find_spec("compiled")
