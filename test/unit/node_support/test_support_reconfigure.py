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


def test_every_tunable_field_is_there_with_its_type_and_default(described):
    assert {name: (entry["type"], entry["default"]) for name, entry in described.items()} == {
        "radius": ("double", 1.5), "count": ("int", 20), "fast": ("bool", False), "color": ("str", "red"),
        "step": ("double", 0.1), "inner": ("double", 0.5),
    }  # fmt: skip


def test_ranges_and_units_are_those_of_the_fields(described):
    assert (described["radius"]["min"], described["radius"]["max"]) == (0.0, 10.0)
    assert (described["count"]["min"], described["count"]["max"]) == (1, 1000)
    assert described["radius"]["description"] == "how far [m]"


def test_the_choices_of_an_enumeration_are_offered(described):
    choices = ast.literal_eval(described["color"]["edit_method"])["enum"]
    assert [(choice["name"], choice["value"]) for choice in choices] == [("RED", "red"), ("DEEP_BLUE", "deep+blue")]
