"""What a parameter set says of itself in yaml and in the documentation."""

import pytest
from example_parameters import ExampleParameters

import yaml
from node_support.parameter_text import default_yaml, markdown_table, with_tables


@pytest.fixture
def text():
    return default_yaml("example", ExampleParameters)


def test_the_default_yaml_is_yaml_that_makes_the_defaults(text):
    assert yaml.safe_load(text) == ExampleParameters().to_mapping()
    assert ExampleParameters.from_mapping(yaml.safe_load(text)) == ExampleParameters()


def test_every_key_comes_after_its_meaning_what_is_allowed_and_its_thesis_name(text):
    assert "# how far *\n#   a number from 0 to 10 m; thesis: minRadius\nradius: 1.5\n" in text


def test_keys_that_only_the_start_can_set_have_no_star(text):
    assert '# which frame\n#   a text that is not empty\nframe: "odom"\n' in text


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


def test_a_document_gets_the_table_behind_its_mark():
    text = "# A node\n\n<!-- parameters: example -->\n\nMore.\n"
    filled = with_tables(text, {"example": ExampleParameters})
    assert filled == text.replace("-->\n", "-->\n\n" + markdown_table(ExampleParameters))
    assert with_tables(filled, {"example": ExampleParameters}) == filled


def test_an_old_table_is_replaced():
    text = "<!-- parameters: example -->\n\n| old |\n| --- |\n| 1 |\n\nMore.\n"
    filled = with_tables(text, {"example": ExampleParameters})
    assert filled == f"<!-- parameters: example -->\n\n{markdown_table(ExampleParameters)}\nMore.\n"


def test_a_mark_of_an_unknown_node_is_an_error():
    with pytest.raises(KeyError, match="nobody"):
        with_tables("<!-- parameters: nobody -->\n", {})
