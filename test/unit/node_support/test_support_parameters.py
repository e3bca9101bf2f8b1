"""Which values a parameter set takes, from where, and what it says of itself, to dynamic_reconfigure too."""

import ast
import dataclasses
import math
import sys
from enum import Enum

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st
from parameter_text import default_yaml, markdown_table

from node_support import parameters as parameters_module
from node_support.parameters import (
    ParameterError,
    ParameterSet,
    assigned_values,
    describe,
    parameter,
    read_values,
    with_defaults,
)
from node_support.ros.reconfigure_description import generator


class Color(Enum):
    """Two choices whose values differ from their names."""

    RED = "red"
    DEEP_BLUE = "deep+blue"


@dataclasses.dataclass(frozen=True)
class ExampleParameters(ParameterSet):
    """A field of every type, and two that must fit together."""

    radius: float = parameter(1.5, "how far", unit="m", low=0.0, high=10.0, thesis_name="minRadius")
    count: int = parameter(20, "how many", low=1, high=1000)
    fast: bool = parameter(False, "whether fast")
    frame: str = parameter("odom", "which frame", tunable=False)
    color: Color = parameter(Color.RED, "which color")
    step: float = parameter(0.1, "how fine", low=0.0, expert="a tenth is fine enough")
    inner: float = parameter(0.5, "not more than radius", unit="m", low=0.0)

    def check(self):
        """Refuse an inner radius that is not inside."""
        if self.inner > self.radius:
            raise ParameterError(f"inner = {self.inner}: must be at most radius = {self.radius}")


THERE_ARE = "there are radius, count, fast, frame, color, step, inner"


@pytest.mark.parametrize(
    ("key", "values", "allowed"),
    [
        (
            "radius",
            [-0.1, 10.1, math.nan, math.inf, "1.0", True, None, [1.0], 10**400],
            "must be a number from 0 to 10 m",
        ),
        ("count", [0, 1001, 5.0, True, "5", 10**400], "must be an integer from 1 to 1000"),
        ("fast", [1, "true"], "must be true or false"),
        ("frame", ["", 5], "must be a non-empty string"),
        ("color", ["blue", "RED", ["red"]], "must be one of red, deep+blue"),
        ("inner", [math.nan], "must be a number from 0 m"),
        ("inner", [2.0], "must be at most radius = 1.5"),
        ("raduis", [2.0], f"no such parameter; did you mean radius? {THERE_ARE}"),
    ],
)
def test_a_bad_key_or_value_is_refused_with_both_and_what_is_allowed(key, values, allowed):
    for value in values:
        with pytest.raises(ParameterError) as refused:
            ExampleParameters.from_mapping({key: value})
        assert str(refused.value) == f"{key} = {value!r}: {allowed}"


def test_what_is_for_experts_is_taken_from_its_own_key_and_beside_it_which_goes_before():
    assert ExampleParameters.from_mapping({"expert": {"step": 0.2}}).step == 0.2
    assert ExampleParameters.from_mapping({"step": 0.3, "expert": {"step": 0.2}}).step == 0.3


@pytest.mark.parametrize(
    ("experts", "text"), [({"raduis": 2.0}, "did you mean radius?"), (1, "must be keys and values")]
)
def test_a_wrong_key_for_experts_is_refused(experts, text):
    with pytest.raises(ParameterError, match=text):
        ExampleParameters.from_mapping({"expert": experts})


def test_plain_values_are_nested_as_they_are_taken():
    nested = ExampleParameters.nested({"step": 0.2, "count": 7})
    assert nested == {"count": 7, "expert": {"step": 0.2}}
    assert ExampleParameters.by_name(nested) == ({"step": 0.2, "count": 7}, [])


def test_keys_of_older_versions_are_taken_over_or_left_out_and_named(monkeypatch):
    old = {"renamed": {"reach": "radius"}, "gone": {"engine": "there is one engine"}}
    monkeypatch.setattr(parameters_module, "old_keys", lambda: old)
    values, remarks = ExampleParameters.by_name({"radius": 1.0, "reach": 2.0, "engine": "steam"})
    assert values == {"radius": 2.0}
    assert remarks == ["reach -> radius", "engine -> nothing (there is one engine)"]


@pytest.mark.parametrize(("key", "value"), [("radius", 0.0), ("radius", 10.0), ("count", 1), ("count", 1000)])
def test_bounds_are_allowed(key, value):
    parameters = ExampleParameters.from_mapping({"inner": 0.0, key: value})
    assert getattr(parameters, key) == value


def test_an_integer_is_taken_for_a_float_and_becomes_one():
    radius = ExampleParameters(radius=3).radius
    assert (radius, type(radius)) == (3.0, float)


@pytest.mark.parametrize("value", [Color.DEEP_BLUE, "deep+blue"])
def test_an_enumeration_is_taken_as_member_or_by_value(value):
    assert ExampleParameters(color=value).color is Color.DEEP_BLUE


def test_a_change_is_checked_against_the_values_that_stay():
    with pytest.raises(ParameterError, match="inner"):
        ExampleParameters().changed({"radius": 0.1})


@given(st.floats(0.5, 10.0), st.integers(1, 1000), st.booleans(), st.text(min_size=1), st.sampled_from(list(Color)))
def test_plain_values_make_the_same_set_again(radius, count, fast, frame, color):
    parameters = ExampleParameters(radius, count, fast, frame, color)
    assert ExampleParameters.from_mapping(parameters.to_mapping()) == parameters


@dataclasses.dataclass(frozen=True)
@with_defaults(radius=2.0, color="deep+blue")
class WiderParameters(ExampleParameters):
    """The same parameters with two other defaults."""


def test_a_derived_set_has_other_defaults_and_the_same_parameters():
    assert WiderParameters() == WiderParameters(radius=2.0, color=Color.DEEP_BLUE)
    fields, derived = dataclasses.fields(ExampleParameters), dataclasses.fields(WiderParameters)
    assert [(one.name, one.type, describe(one)) for one in derived] == [
        (one.name, one.type, describe(one)) for one in fields
    ]
    assert ExampleParameters().radius == 1.5


@pytest.mark.parametrize("defaults", [{"radius": 10.1}, {"no_such": 1}])
def test_a_default_that_is_not_allowed_is_refused(defaults):
    with pytest.raises(ParameterError, match=next(iter(defaults))):
        with_defaults(**defaults)(type("Derived", (ExampleParameters,), {}))


@pytest.fixture
def text():
    return default_yaml("example", ExampleParameters)


def test_the_default_yaml_is_yaml_that_makes_the_defaults(text):
    assert yaml.safe_load(text) == ExampleParameters.nested(ExampleParameters().to_mapping())
    assert ExampleParameters.from_mapping(yaml.safe_load(text)) == ExampleParameters()


@pytest.mark.parametrize(
    "entry",
    [
        "# how far *\n#   a number from 0 to 10 m; thesis: minRadius\nradius: 1.5\n",
        # What only the start can set has no star.
        '# which frame\n#   a non-empty string\nframe: "odom"\n',
        '#   one of red, deep+blue\ncolor: "red"\n',
    ],
)
def test_every_key_comes_after_its_meaning_what_is_allowed_and_its_thesis_name(text, entry):
    assert entry in text


def test_what_is_for_experts_stands_under_a_key_of_its_own_with_the_reason_for_its_default(text):
    assert text.endswith(
        "expert:\n\n  # how fine *\n  #   a number from 0\n  #   default: a tenth is fine enough\n  step: 0.1\n"
    )


def test_the_table_has_a_row_of_seven_cells_for_every_parameter_and_what_is_for_experts_last():
    rows = markdown_table(ExampleParameters).splitlines()
    assert len(rows) == 2 + len(ExampleParameters().to_mapping())
    assert {row.count("|") for row in rows} == {8}
    assert rows[2] == "| `radius` * | float | `1.5` | a number from 0 to 10 | m | minRadius | how far |"
    last = "| `expert/step` * | float | `0.1` | a number from 0 |  |  | how fine. Default: a tenth is fine enough |"
    assert rows[-1] == last


def test_a_file_gives_its_values_by_their_keys(tmp_path):
    (tmp_path / "own.yaml").write_text("resolution: 0.1\nsonar: {rays: 15}\n")
    assert read_values(tmp_path / "own.yaml") == {"resolution": 0.1, "sonar": {"rays": 15}}


@pytest.mark.parametrize(
    ("content", "fault"),
    [(b"a: [", "not yaml"), (b"\xff", "not yaml"), (b"- 1", "must hold lines of KEY: VALUE"), (b"", "must hold lines"),
     (None, "No such file")],
)  # fmt: skip
def test_a_file_without_values_is_refused_by_its_name(tmp_path, content, fault):
    if content is not None:
        (tmp_path / "own.yaml").write_bytes(content)
    with pytest.raises(ParameterError, match=rf"own\.yaml: {fault}"):
        read_values(tmp_path / "own.yaml")


def test_of_several_values_for_one_key_the_last_one_counts():
    assert assigned_values(["seed=1", "name=a=b", "seed=2"]) == {"seed": 2, "name": "a=b"}


@pytest.mark.parametrize("text", ["seed", "=1", "", "seed=["])
def test_a_text_without_key_or_value_is_refused(text):
    with pytest.raises(ParameterError, match="--set"):
        assigned_values([text])


@pytest.fixture
def described(monkeypatch):
    # The generator takes its output folders from the command line of a .cfg file, and wants it to be there.
    monkeypatch.setattr(sys, "argv", ["Example.cfg", "devel", "share", "include", "python"])
    return {entry["name"]: entry for entry in generator(ExampleParameters).group.parameters}


def test_every_tunable_field_is_there_with_its_type_default_range_and_unit(described):
    assert {name: (entry["type"], entry["default"]) for name, entry in described.items()} == {
        "radius": ("double", 1.5), "count": ("int", 20), "fast": ("bool", False), "color": ("str", "red"),
        "step": ("double", 0.1), "inner": ("double", 0.5),
    }  # fmt: skip
    assert (described["radius"]["min"], described["radius"]["max"]) == (0.0, 10.0)
    assert (described["count"]["min"], described["count"]["max"]) == (1, 1000)
    assert described["radius"]["description"] == "how far [m]"


def test_the_choices_of_an_enumeration_are_offered(described):
    choices = ast.literal_eval(described["color"]["edit_method"])["enum"]
    assert [(choice["name"], choice["value"]) for choice in choices] == [("RED", "red"), ("DEEP_BLUE", "deep+blue")]
