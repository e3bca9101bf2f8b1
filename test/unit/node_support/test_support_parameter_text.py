"""What a parameter set says of itself in yaml and in the documentation."""

import pytest
import yaml
from example_parameters import ExampleParameters

from node_support.parameter_text import default_yaml, markdown_table


@pytest.fixture
def text():
    return default_yaml("example", ExampleParameters)


def test_the_default_yaml_is_yaml_that_makes_the_defaults(text):
    assert yaml.safe_load(text) == ExampleParameters.nested(ExampleParameters().to_mapping())
    assert ExampleParameters.from_mapping(yaml.safe_load(text)) == ExampleParameters()


def test_every_key_comes_after_its_meaning_what_is_allowed_and_its_thesis_name(text):
    assert "# how far *\n#   a number from 0 to 10 m; thesis: minRadius\nradius: 1.5\n" in text


def test_keys_that_only_the_start_can_set_have_no_star(text):
    assert '# which frame\n#   a non-empty string\nframe: "odom"\n' in text


def test_what_is_for_experts_stands_under_a_key_of_its_own_with_the_reason_for_its_default(text):
    assert text.endswith(
        "expert:\n\n  # how fine *\n  #   a number from 0\n  #   default: a tenth is fine enough\n  step: 0.1\n"
    )


def test_the_table_names_what_is_for_experts_last():
    row = markdown_table(ExampleParameters).splitlines()[-1]
    assert row == (
        "| `expert/step` * | float | `0.1` | a number from 0 |  |  | how fine. Default: a tenth is fine enough |"
    )


def test_choices_are_named(text):
    assert '#   one of red, deep+blue\ncolor: "red"\n' in text


def test_the_table_has_a_row_of_seven_cells_for_every_parameter():
    rows = markdown_table(ExampleParameters).splitlines()
    assert len(rows) == 2 + len(ExampleParameters().to_mapping())
    assert {row.count("|") for row in rows} == {8}


def test_a_row_holds_name_type_default_range_unit_thesis_name_and_meaning():
    assert "| `radius` * | float | `1.5` | a number from 0 to 10 | m | minRadius | how far |" in markdown_table(
        ExampleParameters
    )
