"""yaml/thesis.yaml: everything as the thesis of 2015 has it, live and in map_bag."""

import pytest
import yaml
from document import LIVE_NODES
from launch_files import launched
from programs import ROOT

from mlsm_manager.offline.map_bag import map_bag, map_bag_arguments
from mlsm_manager.offline.thesis_chain import ThesisChain, thesis_values
from sonar_simulator.simulation.simulation import GROUPS

TEXT = (ROOT / "yaml/thesis.yaml").read_text()
THESIS = yaml.safe_load(TEXT)


def test_every_node_takes_its_part():
    simulator = THESIS["sonar_simulator"]
    assert {group: GROUPS[group].from_mapping(values) for group, values in simulator.items()}
    nodes = {name: LIVE_NODES[name].from_mapping(values) for name, values in THESIS.items() if name in LIVE_NODES}
    assert {*nodes, "sonar_simulator"} == set(THESIS)


def test_every_value_has_its_source():
    """A comment with a section, or with a file of 2015, stands above each run of values."""
    sourced = False
    for line in TEXT.splitlines()[4:]:
        words = line.strip()
        if words.startswith("#"):
            sourced = any(sign in words for sign in (".cpp", ".yaml", "4.", "6."))
        elif not words or words.endswith(":"):
            sourced = sourced and words == "expert:"
        else:
            assert sourced, line


@pytest.mark.parametrize(
    "launch",
    [
        ("mapping.launch", "processes:=many"), ("vehicle.launch",), ("demo.launch", "rviz:=false"),
        ("play_bag.launch", "bag:=/no.bag", "rviz:=false"),
    ],
    ids=lambda launch: launch[0],
)  # fmt: skip
def test_launch_files_load_it_over_the_nodes_own_and_under_what_is_given(launch, tmp_path):
    given = tmp_path / "given.yaml"
    given.write_text("thresholder: {min_threshold: 20.0}\n")
    own = () if launch[0] == "demo.launch" else (f"parameters:={given}",)
    found = launched(*launch, "thesis:=true", *own)
    assert found["/mlsm_core/estimator"] == "THESIS"
    assert found["/sonar_to_cloud/bin_place"] == 1.0
    assert found["/thresholder/min_threshold"] == (20.0 if own else 50.0)
    assert launched(*launch)["/mlsm_core/estimator"] == "JOINT"


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """Return the summary and the folder of a map made by the thesis's chain, with another floor of the threshold."""
    out = tmp_path_factory.mktemp("thesis")
    own = out / "own.yaml"
    own.write_text("thresholder: {min_threshold: 40.0}\nmlsm_core: {resolution: 0.5}\n")
    arguments = [str(ROOT / "test/data/basin.bag"), "--thesis", "--parameters", str(own), "--out", str(out)]
    return map_bag(map_bag_arguments(arguments)), out


@pytest.mark.long
def test_map_bag_matches_each_cleaned_cloud_alone(run):
    summary, _ = run
    assert (summary["scans"], summary["matched"], summary["rejected"]) == (10, 9, 0)
    assert summary["blocks"] > 300


@pytest.mark.long
def test_its_live_yaml_makes_the_live_nodes_do_the_same(run):
    _, out = run
    live = yaml.safe_load((out / "live.yaml").read_text())
    own = {"thresholder": {"min_threshold": 40.0}, "mlsm_core": {"resolution": 0.5}}
    assert ThesisChain.from_values(live) == ThesisChain.from_values(thesis_values(own))
    assert (live["mlsm_core"]["match_input"], live["mlsm_core"]["resolution"]) == ("CLEANED", 0.5)


@pytest.mark.parametrize("more", [["other.bag"], ["--refine"]], ids=" ".join)
def test_it_maps_one_recording_scan_by_scan(more):
    with pytest.raises((SystemExit, ValueError)):
        map_bag_arguments(["one.bag", *more, "--thesis", "--out", "out"])
