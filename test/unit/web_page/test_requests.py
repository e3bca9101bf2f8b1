"""What a page may ask for, and that nothing else gets through, whoever sends it."""

import json

import pytest

from node_support.errors import RefusedInput
from node_support.marks import Mark
from web_page.messages import DeleteMark, Hello, parsed, text_of


def test_a_page_says_hello_and_sets_and_deletes_marks():
    assert parsed('{"hello": {"run": "a.1", "revision": 7}}') == Hello("a.1", 7)
    assert parsed('{"mark": {"name": "Bøje ⚓", "x": 1.5, "y": -2}}') == Mark("Bøje ⚓", 1.5, -2)
    assert parsed('{"delete": {"name": "block"}}') == DeleteMark("block")


def _mark(**changed):
    return json.dumps({"mark": {"name": "block", "x": 0.0, "y": 0.0, **changed}})


@pytest.mark.parametrize(
    "text",
    [
        "", "[]", "{}", "null", "7", '"hello"', "[" * 900, b"\x00\xff", "x" * 5000, '{"hello": {}}', '{"hello": 3}',
        '{"hello": {"run": 1, "revision": 1}}', '{"hello": {"run": "a", "revision": 1.5}}', '{"drive": {}}',
        '{"mark": {}, "delete": {}}', '{"delete": {"name": 5}}', _mark(name=""), _mark(name="a" * 61), _mark(name=7),
        _mark(name="a\nb"), _mark(name="\u202eb"), _mark(x="1"), _mark(x=None), _mark(x=True), _mark(y=1e9),
        '{"mark": {"name": "a", "x": NaN, "y": 0}}', '{"mark": {"name": "a", "x": 0, "y": 1e999}}', '{"\\ud800": 1}',
    ],
)  # fmt: skip
def test_anything_else_is_refused(text):
    with pytest.raises(RefusedInput):
        parsed(text)


def test_what_is_not_finite_becomes_null():
    assert json.loads(text_of(age=float("nan"), rows=[[1.0, float("inf")]])) == {"age": None, "rows": [[1.0, None]]}
