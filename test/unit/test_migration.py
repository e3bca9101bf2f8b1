"""Bags that the 2015 package recorded come out of `rosbag fix` as ours."""

import re
import subprocess

import genpy
import numpy as np
import pytest
import rosbag
from foreign_messages import serialised
from old_bag import old_type
from programs import ROOT

from sonar_processing.ros.conversions import header, point_cloud
from underwater_map_construction.msg import SonarScanLine, StampedIntensityCloud

RULES = ROOT / "migration" / "avora_msgs.bmr"
START = genpy.Time(1400000000, 123456789)


def _recorded():
    """Return what a bag shall hold, as messages of today: (topic, message)."""
    rng = np.random.default_rng(0)
    strengths = rng.integers(0, 256, 500, dtype=np.uint8).tobytes()
    line = SonarScanLine(header(START.to_nsec(), "sonar"), -0.05, strengths, 50.0, 0.1, 21, 0.25)
    points = point_cloud(rng.normal(size=(40, 4)), START.to_nsec() + 1, "odom", height=2)
    cloud = StampedIntensityCloud(header(START.to_nsec(), "odom"), points, rng.normal(size=40).tolist())
    return [("/sonar/raw", line), ("/sonar/scan/cleaned", cloud)]


@pytest.fixture(scope="module")
def old_bag(tmp_path_factory):
    """Return the path of a bag of old types."""
    path = tmp_path_factory.mktemp("bags") / "old.bag"
    with rosbag.Bag(str(path), "w") as bag:
        for second, (topic, message) in enumerate(_recorded()):
            old = old_type(type(message))().deserialize(serialised(message))
            bag.write(topic, old, START + genpy.Duration(second))
    return path


def _documented_commands():
    """Return the commands with `rosbag fix` that the documents tell a user to type."""
    pages = [ROOT / "README.md", *(ROOT / "docs").glob("*.md"), *(ROOT / "migration").glob("*.md")]
    lines = [line.strip() for page in pages for line in page.read_text().splitlines()]
    return sorted({line for line in lines if line.startswith("rosbag fix ") and ".bmr" in line})


@pytest.fixture(scope="module", params=_documented_commands())
def fixed(request, old_bag):
    """Return what a documented command makes of the bag of old types: (topic, message, time of recording)."""
    command = ["bash", "-c", request.param]
    run = subprocess.run(command, cwd=str(old_bag.parent), stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    assert run.returncode == 0, run.stdout
    with rosbag.Bag(str(old_bag.parent / "new.bag")) as bag:
        return list(bag.read_messages())


def test_the_documents_say_how_to_fix_a_bag():
    assert _documented_commands() != []


@pytest.mark.parametrize("new_type", [SonarScanLine, StampedIntensityCloud])
def test_the_old_types_are_those_that_the_rules_are_for(new_type):
    old = old_type(new_type)
    assert f"class update_{old._type.replace('/', '_')}_{old._md5sum}(" in RULES.read_text()


def test_every_message_comes_out_as_one_of_ours_with_its_bytes_topic_and_time(fixed):
    expected = [
        (topic, message._type, message._md5sum, serialised(message), START + genpy.Duration(second))
        for second, (topic, message) in enumerate(_recorded())
    ]
    assert expected == [(topic, one._type, one._md5sum, serialised(one), time) for topic, one, time in fixed]


def test_the_package_exports_the_rules():
    exported = re.search(r'<rosbag migration_rule_file="([^"]+)"/>', (ROOT / "package.xml").read_text())
    assert ROOT / exported.group(1) == RULES
