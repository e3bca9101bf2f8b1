"""The table of the names of 2015 is true of this package, and migrate_yaml makes today's parameters by it."""

import argparse
import dataclasses
import re

import pytest
import yaml
from document import LIVE_NODES
from launch_files import launched
from programs import ROOT

from mlsm_manager.migrate_yaml import KEYS, NODES, TABLE, migrated, migrated_text
from node_support.help import HOSTS
from node_support.node_table import NODES as DESCRIBED
from node_support.parameters import ParameterError, describe

FILES = {
    "MLSM_Core_default": {
        "cloudSubscribeTopic": "/sonar/scan/cleaned", "resolution": 0.6, "sizeXMeters": 120, "fastUpdate": False,
        "maxIterations": 10, "errorThreshold": 0.3,
    },
    "OutlierRemover_default": {"mode": "STATISTICAL", "stddevMulThresh": 0, "meanK": 100},
    "SonarToCloud_default": {
        "mode": "SONAR", "sonarSubscribeTopic": "/charle/sonar", "velSubscribeTopic": "/cmd_vel", "dispersedPoints": 10,
    },
    "Thresholder_default": {"mode": "OTSU", "keepOrganized": False},
    "Wall2DDetector_default": {"mode": "RANSAC", "RANSACDistance": 0.1, "RANSACMaxIterations": 1000000},
}  # fmt: skip
"""As the files of 2015 are."""


_PASSED_ON = [
    before
    for names in TABLE["names"].values()
    for before, now in names.items()
    if "`thesis:=true`" in now.get("remark", "")
]


def named(*kinds):
    names = [now["here"] for kind in kinds for now in TABLE["names"][kind].values() if "here" in now]
    return pytest.mark.parametrize("name", names)


@named("Nodes and nodelets")
def test_every_node_exists(name):
    """And is started by every_node.test, but for those that host several of them."""
    assert name in {**DESCRIBED, **HOSTS}


@named("Launch files")
def test_every_launch_file_can_be_launched(name):
    """With everything that it includes."""
    assert launched(name)


def _served(node):
    """Return the names of a node's topics and services, which every_node.test compares with the running node."""
    return {one.name.replace("~", f"{node}/") for one in DESCRIBED[node].interfaces}


@named("Topics", "Services")
def test_every_topic_and_service_is_one_of_a_running_node(name):
    served = {"/tf"}.union(*map(_served, DESCRIBED))
    assert name in served or name.rpartition("/")[0] in served


@pytest.mark.parametrize("name", _PASSED_ON)
def test_old_names_are_those_of_thesis_topics(name):
    """Each of which old_names.test sends a message through, or calls."""
    served = {name.lstrip("/") for name in _served("thesis_topics")}
    before = {name.split(" ")[0].lstrip("/") for name in name.split(", ")}
    assert before & served


@named("Fields of messages")
def test_every_message_and_field_exists(name):
    message, _, field = name.partition(".")
    assert re.search(rf"\s{field}$" if field else "", (ROOT / f"msg/{message}.msg").read_text(), re.MULTILINE)


@pytest.mark.parametrize("key", [key for key in KEYS if key.here], ids=lambda key: f"{key.owner} {key.key}")
def test_the_default_of_2015_becomes_todays_parameter(key):
    values = yaml.safe_load(migrated_text({key.owner: {key.key: key.before}}))[key.node]
    assert NODES[key.node].from_mapping(values).to_mapping()[key.here] == key.before


@pytest.mark.parametrize("key", [key for key in KEYS if not key.here], ids=lambda key: f"{key.owner} {key.key}")
def test_what_has_no_counterpart_is_kept_as_a_comment_with_the_reason(key):
    text = migrated_text({key.owner: {key.key: key.before}})
    assert yaml.safe_load(text) == {key.node: {}}
    assert f"# {key.key}: " in text
    assert key.remark in text


@pytest.mark.parametrize("node", [node for node in NODES if node != "sonar_control"])
def test_the_dataclasses_name_the_same_keys(node):
    told = {field.name: describe(field).thesis_name for field in dataclasses.fields(LIVE_NODES[node])}
    table = {key.here: key.key for key in KEYS if key.node == node and key.here and key.key != "horizontalOpening"}
    assert table == {name: thesis for name, thesis in told.items() if thesis}


@pytest.mark.parametrize(
    ("owner", "before", "after"),
    [
        ("SonarToCloud", "CONTLASER", "LASERCONT"), ("Thresholder", "OTSUPROPORTIONAL", "OTSU+PROPORTIONAL"),
        ("Thresholder", "FIXED", "FIXED"), ("OutlierRemover", "NONE", "RADIUS"),
    ],
)  # fmt: skip
def test_modes_were_found_by_their_parts(owner, before, after):
    assert list(yaml.safe_load(migrated_text({owner: {"mode": before}})).values()) == [{"mode": after}]


def written(folder, files):
    for name, values in files.items():
        (folder / f"{name}.yaml").write_text(yaml.safe_dump(values))
    files = [folder / f"{name}.yaml" for name in files]
    return argparse.Namespace(files=files, out=folder / "out", overwrite=False)


def test_the_files_of_2015_become_one_that_the_nodes_take(tmp_path):
    told = migrated(written(tmp_path, FILES))
    assert told[0].endswith("12 of 18 values taken over, 6 kept as comments")
    assert told[1].endswith("beams:=/charle/sonar")
    found = launched("mapping.launch", "thesis:=true", f"parameters:={tmp_path / 'out/parameters.yaml'}")
    assert (found["/mlsm_core/resolution"], found["/mlsm_core/match_resolution"]) == (0.6, 0.6)
    assert found["/mlsm_core/expert/max_iterations"] == 10
    assert (found["/outlier_remover/mean_k"], found["/line_detector/max_iterations"]) == (100, 1000000)
    assert found["/mlsm_core/expert/error_threshold"] == 100.0


def test_a_file_that_exists_is_replaced_only_if_asked(tmp_path):
    options = written(tmp_path, FILES)
    migrated(options)
    with pytest.raises(FileExistsError, match="--overwrite replaces it"):
        migrated(options)
    options.overwrite = True
    migrated(options)


def test_a_dump_names_its_nodes_and_a_file_of_another_name_tells_by_its_keys(tmp_path):
    dump = {"ThresholderNodelet": {"minThreshold": 40}, "MLSM_core": {"nSamples": 3}}
    migrated(written(tmp_path, {"dump": dump, "mine": {"meanK": 30}}))
    found = yaml.safe_load((tmp_path / "out/parameters.yaml").read_text())
    assert found == {
        "thresholder": {"min_threshold": 40}, "mlsm_core": {"expert": {"n_samples": 3}},
        "outlier_remover": {"mean_k": 30},
    }  # fmt: skip


@pytest.mark.parametrize(
    ("files", "said"),
    [
        ({"mine": {"mode": "OTSU"}}, "must be named as one of SonarToCloud"),
        ({"Thresholder_default": {"minTreshold": 3}}, "minTreshold: no parameter of Thresholder"),
        ({"OutlierRemover_default": {"meanK": 0}}, "mean_k = 0"),
    ],
)
def test_what_it_cannot_understand_is_named_and_nothing_is_written(tmp_path, files, said):
    with pytest.raises(ParameterError, match=said):
        migrated(written(tmp_path, files))
    assert not (tmp_path / "out").exists()
