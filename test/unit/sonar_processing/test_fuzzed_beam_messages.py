"""Damaged messages of other packages' sonars crash nothing, and each is counted."""

import pytest
from fuzzed_beams import fuzz

MESSAGES = 5000


# genpy warns of names that are no UTF-8, and its generated code writes arrays with the old name of tobytes.
@pytest.mark.filterwarnings("ignore")
def test_no_damaged_message_crashes_and_each_is_counted():
    fuzzer = fuzz(MESSAGES, seed=2)
    assert fuzzer.crashes == []
    assert sum(fuzzer.outcomes.values()) == MESSAGES
    assert set(fuzzer.outcomes) >= {"taken", "beams refused", "stamps refused", "messages not readable"}
