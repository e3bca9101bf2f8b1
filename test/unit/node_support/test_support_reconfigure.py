"""What dynamic_reconfigure learns of a parameter set."""

import ast
import sys

import pytest
from example_parameters import ExampleParameters

from node_support.ros.reconfigure_description import generator


@pytest.fixture
def described(monkeypatch):
    # The generator takes its output folders from the command line of a .cfg file, and wants it to be there.
    monkeypatch.setattr(sys, "argv", ["Example.cfg", "devel", "share", "include", "python"])
    return {entry["name"]: entry for entry in generator(ExampleParameters).group.parameters}


def test_every_tunable_field_is_there_and_no_other(described):
    assert list(described) == ["radius", "count", "fast", "color", "step", "inner"]


@pytest.mark.parametrize(
    ("name", "kind", "default"),
    [("radius", "double", 1.5), ("count", "int", 20), ("fast", "bool", False), ("color", "str", "red")],
)
def test_types_and_defaults_are_those_of_the_fields(described, name, kind, default):
    assert (described[name]["type"], described[name]["default"]) == (kind, default)


def test_ranges_are_those_of_the_fields(described):
    assert (described["radius"]["min"], described["radius"]["max"]) == (0.0, 10.0)
    assert (described["count"]["min"], described["count"]["max"]) == (1, 1000)


def test_the_unit_is_in_the_description(described):
    assert described["radius"]["description"] == "how far [m]"


def test_the_choices_of_an_enumeration_are_offered(described):
    choices = ast.literal_eval(described["color"]["edit_method"])["enum"]
    assert [(choice["name"], choice["value"]) for choice in choices] == [("RED", "red"), ("DEEP_BLUE", "deep+blue")]
