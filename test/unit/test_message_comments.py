"""What people read who use a message without the code."""

import re

import pytest
from programs import ROOT

MESSAGES = sorted([*ROOT.glob("msg/*.msg"), *ROOT.glob("srv/*.srv")])
MEASURED = re.compile(r"(float\d\d|geometry_msgs/Point)\S* \w+")
UNIT = re.compile(r"\[(m|s|rad)\b.*\]")


@pytest.mark.parametrize("path", MESSAGES, ids=lambda path: path.name)
def test_each_message_begins_with_what_it_is(path):
    assert path.read_text().startswith("# ")


@pytest.mark.parametrize("path", MESSAGES, ids=lambda path: path.name)
def test_the_comment_above_a_measured_field_names_its_unit(path):
    comment, unnamed, was_comment = "", [], False
    for line in path.read_text().splitlines():
        is_comment = line.startswith("#")
        if is_comment:
            comment = comment + line if was_comment else line
        elif MEASURED.fullmatch(line) and not UNIT.search(comment) and "seconds" not in comment:
            unnamed.append(line)
        was_comment = is_comment
    assert unnamed == []
