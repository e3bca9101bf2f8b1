"""The package works from where `catkin_make install` put it, without the checkout and its development space."""

import os
import re
import shutil
import signal
import subprocess
import sys
import threading
from pathlib import Path

import pytest

sys.path.append(str(Path(__file__).resolve().parents[1] / "stopping"))

from stopwatch import free_port

ROOT = Path(__file__).resolve().parents[2]
WORKSPACE = ROOT / "build/workspace"
PACKAGE = "underwater_map_construction"
RAYS = "--set sonar.ray_rows=5 --set sonar.ray_columns=2"
PORT = free_port()


@pytest.fixture(scope="module")
def prefix(tmp_path_factory):
    """Return the folder of an installation that holds nothing of this checkout."""
    staged, prefix = tmp_path_factory.mktemp("staged"), tmp_path_factory.mktemp("prefix") / "install"
    make = ["make", "-C", str(WORKSPACE / "build"), "install"]
    done = subprocess.run(make, env={**os.environ, "DESTDIR": str(staged)}, stdout=subprocess.PIPE, text=True)
    assert done.returncode == 0, done.stdout
    # The workspace of scripts/bootstrap consists of links, which make installs as links: copy what they point to.
    shutil.copytree(str(staged / str(WORKSPACE / "install").lstrip("/")), str(prefix))
    _copy_compiled_loops(next(prefix.rglob("node_support")).parent)
    return prefix


def _copy_compiled_loops(modules):
    """Spare the installed programs half a minute: numba takes what it compiled for a file of the same time and size."""
    for loop in (ROOT / "src").rglob("__pycache__/*.nb[ci]"):
        source = loop.parent.parent / f"{loop.name.split('.')[0]}.py"
        # What was compiled for a file that is gone stays in its folder.
        if source.is_file():
            installed = modules / source.relative_to(ROOT / "src")
            (installed.parent / "__pycache__").mkdir(exist_ok=True)
            shutil.copy(str(loop), str(installed.parent / "__pycache__"))
            shutil.copystat(str(source), str(installed))


def _environment():
    """Return what a new shell has, with the virtual environment that holds the ray caster."""
    path = os.pathsep.join([str(ROOT / "build/venv/bin"), "/usr/bin", "/bin"])
    master = f"http://localhost:{PORT}"
    return {"HOME": os.environ.get("HOME", "/"), "PATH": path, "ROS_MASTER_URI": master, "OMP_NUM_THREADS": "1"}


def _shell(prefix, command):
    noetic = "[ ! -f /opt/ros/noetic/setup.bash ] || source /opt/ros/noetic/setup.bash; "
    return ["bash", "-c", f'{noetic}source "{prefix}/setup.bash" && exec {command}']


def _run(prefix, command):
    done = subprocess.run(
        _shell(prefix, command), env=_environment(), cwd=str(prefix), stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT, text=True, timeout=720,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout
    return done.stdout


def test_the_package_is_found_in_the_installation(prefix):
    assert _run(prefix, f"rospack find {PACKAGE}").strip() == str(prefix / "share" / PACKAGE)


def test_modules_come_from_the_installation(prefix):
    modules = "node_support, sonar_processing, mlsm_manager, sonar_simulator, imagenex_852_driver"
    found = _run(prefix, f"python3 -c 'import {modules}; print([m.__file__ for m in ({modules})])'")
    assert found.count(str(prefix)) == 5


def test_a_bag_is_simulated_and_looked_into(prefix, tmp_path):
    script, bag = tmp_path / "script.yaml", tmp_path / "basin.bag"
    script.write_text("moves: [{wait: 5}]")
    _run(prefix, f"rosrun {PACKAGE} simulate_bag --world basin --script {script} --out {bag} --quiet {RAYS}")
    assert "beams" in _run(prefix, f"rosrun {PACKAGE} map_bag --inspect {bag}")


def test_the_demo_maps_until_it_is_interrupted(prefix):
    command = f"roslaunch -p {PORT} {PACKAGE} demo.launch rviz:=false real_time_factor:=20"
    demo = subprocess.Popen(
        _shell(prefix, command), env=_environment(), cwd=str(prefix), stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT, text=True,
    )  # fmt: skip
    output = []
    reader = threading.Thread(target=lambda: output.extend(demo.stdout), daemon=True)
    reader.start()
    try:
        listen = 'timeout 600 rostopic echo -n 1 --noarr --filter "m.width > 100" /MLSM/cloud'
        told = _run(prefix, f"bash -c 'until rostopic list >/dev/null 2>&1; do sleep 0.2; done; {listen}'")
        width = int(re.search(r"^width: (\d+)$", told, re.MULTILINE)[1])
    finally:
        demo.send_signal(signal.SIGINT)
        demo.wait(timeout=120)
    assert width > 100, "".join(output)
