"""The line and the mapping with which map_bag says whether its run can be trusted."""

import json

import numpy as np

from mlsm_manager.offline.findings import Deviations, Trust
from mlsm_manager.self_check.verdict import Verdict

FINE = Verdict("depth", 0.5, 1.0, "m")
FIRING = Verdict("width", 2.0, 1.0, "too wide (2 m)", doubtful=np.array([[3.0, 9.0]]))
SHORT = Verdict("length", np.nan, 1.0, "m")


def trust_of(*verdicts, times=(0.0, 10.0, 200.0)):
    covariances = np.tile(np.diag([9.0, 16.0]), (len(times), 1, 1))
    return Trust(list(verdicts), Deviations(np.array(times), covariances))


def test_a_run_without_doubts_says_so():
    assert trust_of(FINE, SHORT).line == "trust: all 2 checks are fine"
    assert trust_of(FINE).doubtful.shape == (0, 2)


def test_only_the_checks_that_fire_are_named():
    trust = trust_of(FINE, FIRING)
    assert trust.line == "trust: DOUBTFUL: too wide (2 m)"
    np.testing.assert_array_equal(trust.doubtful, [[3.0, 9.0]])


def test_what_it_cannot_tell_is_null_in_json():
    told = trust_of(SHORT).to_mapping()
    assert told["checks"]["length"]["value"] is None
    assert told["deviation_per_minute"] == [5.0, None, None, 5.0]
    json.dumps(told, allow_nan=False)
