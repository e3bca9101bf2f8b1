"""What scripts/bootstrap would do, on this system and on the other."""

import os
import re
import shutil
import subprocess
from xml.etree import ElementTree as ET

import pytest
import yaml
from programs import ROOT


def _rows(text):
    """Return the words of each dependency, without the first line, which ends a comment."""
    return [line.split() for line in text.splitlines()[1:] if line and not line.startswith("#")]


RUNNING, TESTING = map(_rows, (ROOT / "scripts/dependencies.txt").read_text().split("## Only with --all", 1))
ROWS = RUNNING + TESTING
KEYS = {one.text for one in ET.parse(str(ROOT / "package.xml")).getroot() if one.tag.endswith("depend")}
PIP_KEYS = {key for key in KEYS if key.endswith("-pip")}
ROSDEP = yaml.safe_load((ROOT / "test/data/rosdep_python.yaml").read_text())
CHANGES_THE_SYSTEM = ["apt-get", "sudo", "pip", "catkin_make"]


@pytest.fixture
def checkout(tmp_path):
    """Return a fresh checkout's scripts, with programs that would change the system replaced by ones that tell."""
    shutil.copytree(str(ROOT / "scripts"), str(tmp_path / "checkout" / "scripts"))
    (tmp_path / "bin").mkdir()
    for name in CHANGES_THE_SYSTEM:
        program = tmp_path / "bin" / name
        program.write_text(f"#!/bin/sh\necho {name} >>{tmp_path / 'called'}\n")
        program.chmod(0o755)
    return tmp_path / "checkout"


def _dry_run(checkout, distro, *options):
    """Return what a dry run prints; it must end well."""
    path = os.pathsep.join([str(checkout.parent / "bin"), os.environ["PATH"]])
    command = ["bash", str(checkout / "scripts/bootstrap"), "--dry-run", "--distro", distro, *options]
    done = subprocess.run(command, env={**os.environ, "PATH": path}, stdout=subprocess.PIPE, check=True, text=True)
    return done.stdout.splitlines()


def _installed(lines):
    (install,) = [line for line in lines if "apt-get install" in line]
    return {word for word in install.split("apt-get install", 1)[1].split() if not word.startswith("-")}


@pytest.mark.parametrize(("distro", "column"), [("debian", 1), ("ubuntu", 2)])
def test_a_dry_run_names_every_package_of_its_column_venv_and_build_and_changes_nothing(checkout, distro, column):
    before = sorted(checkout.rglob("*"))
    lines = _dry_run(checkout, distro, "--all")
    assert _installed(lines) == {row[column] for row in ROWS if row[column] != "-"}
    assert any("-m venv --system-site-packages" in line for line in lines)
    assert any("catkin_make --directory" in line for line in lines)
    assert ("+ source /opt/ros/noetic/setup.bash" in lines) == (distro == "ubuntu")
    assert sorted(checkout.rglob("*")) == before
    assert not (checkout.parent / "called").exists()


def test_without_all_what_only_tests_and_docs_need_is_left_out(checkout):
    assert _installed(_dry_run(checkout, "debian")) == {row[1] for row in RUNNING if row[1] != "-"}
    assert {"chromium", "python3-open3d", "python3-sphinx", "python3-pytest"} <= {row[1] for row in TESTING}


def test_on_ubuntu_ros_comes_from_noetic(checkout):
    packages = _installed(_dry_run(checkout, "ubuntu"))
    assert {"ros-noetic-rospy", "ros-noetic-tf2-ros", "ros-noetic-dynamic-reconfigure"} <= packages
    assert "python3-rospy" not in packages


def test_another_system_is_refused_with_those_there_are(checkout):
    command = ["bash", str(checkout / "scripts" / "bootstrap"), "--dry-run", "--distro", "arch"]
    run = subprocess.run(command, stderr=subprocess.PIPE, text=True)
    assert run.returncode == 2
    assert run.stderr == "bootstrap: --distro arch: must be debian or ubuntu\n"


def test_every_dependency_has_a_name_on_both_systems_or_a_dash():
    assert [row for row in ROWS if len(row) != 3] == []
    assert len({row[0] for row in ROWS}) == len(ROWS)


def test_every_key_of_the_package_is_installed():
    assert KEYS - {row[0] for row in ROWS} == set()
    assert "rospy" in KEYS


def test_rosdep_knows_every_pip_key_of_the_package_on_both_systems():
    assert set(ROSDEP) == PIP_KEYS
    assert all(ROSDEP[key][system]["pip"]["packages"] for key in ROSDEP for system in ("debian", "ubuntu"))


def test_every_pip_key_of_the_package_is_in_the_requirements_unless_apt_has_it():
    from_apt = {row[0] for row in ROWS if row[1] != "-"}
    wanted = {ROSDEP[key]["ubuntu"]["pip"]["packages"][0] for key in PIP_KEYS - from_apt}
    required = {re.split("[<>=]", line)[0] for line in (ROOT / "scripts" / "requirements.txt").read_text().splitlines()}
    assert wanted == {"bluerobotics-ping", "trimesh", "pycollada"}
    assert wanted | {"embreex"} <= required
