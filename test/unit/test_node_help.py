"""Every node tells with --help what it is, without a ROS master."""

import dataclasses
import os
import subprocess
import sys

import pytest
from document import LIVE_NODES, START_UP_NODES
from programs import ROOT, run_program

from node_support.help import WIDTH
from node_support.node_table import HOSTS, NODES
from sonar_simulator.simulation.simulation import GROUPS

EXECUTABLES = sorted(path.name for path in (ROOT / "nodes").iterdir())
PARAMETERS = {**LIVE_NODES, **START_UP_NODES}


def _help(node, *arguments):
    done = run_program(node, *arguments, ROS_MASTER_URI="http://localhost:1")
    assert done.returncode == 0, done.stderr
    return done


@pytest.fixture(scope="module", params=EXECUTABLES)
def answer(request):
    """Return the name of a node and what it prints when it is asked for help and there is no master."""
    return request.param, _help(request.param, "--help")


def test_help_needs_no_master_and_ends_well(answer):
    _, done = answer
    assert done.stderr == ""
    assert done.stdout.startswith("usage: ")


def test_help_names_every_topic_and_service_of_the_table(answer):
    node, done = answer
    expected = [one.name for one in NODES[node].interfaces] if node in NODES else []
    assert [name for name in expected if f"\n  {name}" not in done.stdout] == []


def test_help_names_every_parameter(answer):
    node, done = answer
    fields = dataclasses.fields(PARAMETERS[node]) if node in PARAMETERS else []
    assert [field.name for field in fields if f"\n  {field.name}" not in done.stdout] == []


def test_help_fits_a_narrow_terminal(answer):
    node, done = answer
    told = [line for line in done.stdout.splitlines() if not line.lstrip().startswith(("usage:", "or:", "rosrun"))]
    assert [line for line in told if len(line) > WIDTH and node in PARAMETERS] == []


def test_help_names_the_parameters_in_groups():
    told = _help("sonar_simulator", "--help").stdout
    fields = [f"{name}/{field.name}" for name, group in GROUPS.items() for field in dataclasses.fields(group)]
    assert [field for field in fields if f"\n  {field}\n" not in told] == []


def test_a_host_names_the_nodes_that_it_hosts():
    told = _help("mapping", "-h").stdout
    assert [name for name in HOSTS["mapping"].hosted if f"{name} --help" not in told] == []


def test_the_arguments_that_roslaunch_adds_do_not_hide_the_question():
    assert _help("thresholder", "__name:=other", "--help").stdout.startswith("usage: ")


def test_every_node_is_described_and_nothing_else():
    programs = {
        "convert_bag", "map_bag", "map_tool", "migrate_yaml", "play_852", "play_bag", "record_852", "simulate_bag",
    }  # fmt: skip
    assert {*NODES, *HOSTS, *programs} == set(EXECUTABLES)
    assert set(PARAMETERS) <= set(NODES)


# A node, a process of several nodes, and a command line: each writes its help in its own way.
@pytest.mark.parametrize("node", ["mlsm_core", "mapping", "map_tool"])
def test_help_that_nobody_reads_to_its_end_ends_without_a_word(node):
    if node in {"mlsm_core", "mapping"}:
        pytest.importorskip("tf2_py")
    reader, writer = os.pipe()
    os.close(reader)
    command = [sys.executable, str(ROOT / "nodes" / node), "--help"]
    done = subprocess.run(command, stdout=writer, stderr=subprocess.PIPE, text=True, timeout=120, check=False)
    os.close(writer)
    assert done.stderr == ""
