"""The systemd units are sound, and start launch files with arguments that these know."""

import re
import shutil
import subprocess

import pytest
from programs import ROOT
from roslaunch.arg_dump import get_args

UNITS = sorted((ROOT / "systemd").glob("*.service"))


@pytest.mark.skipif(shutil.which("systemd-analyze") is None, reason="systemd-analyze is not installed")
@pytest.mark.parametrize("unit", UNITS, ids=lambda path: path.stem)
def test_systemd_finds_nothing_wrong_with_a_unit(unit):
    done = subprocess.run(["systemd-analyze", "verify", str(unit)], stdout=-1, stderr=subprocess.STDOUT, text=True)
    assert [line for line in done.stdout.splitlines() if unit.name in line] == []


@pytest.mark.parametrize("unit", UNITS, ids=lambda path: path.stem)
def test_a_unit_gives_its_launch_file_arguments_that_it_knows(unit):
    (command,) = re.findall(r"^ExecStart=(.*)$", unit.read_text(), re.MULTILINE)
    for name in re.findall(r"(\w+)\.launch", command):
        known = get_args([str(ROOT / f"launch/{name}.launch")])
        assert set(re.findall(r"(\w+):=", command)) <= set(known)


def test_the_vehicle_starts_anew_with_its_master_which_has_lost_all_parameters():
    told = (ROOT / "systemd/umc-vehicle.service").read_text()
    assert re.search(r"^PartOf=umc-roscore\.service$", told, re.MULTILINE)
    assert re.search(r"^After=.*\bumc-roscore\.service\b", told, re.MULTILINE)
