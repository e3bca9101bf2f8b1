"""scripts/soak: what a run that had errors is told."""

from soaking.verdicts import of_errors

LOGGED = """\
Traceback (most recent call last):
  File "/package/src/node_support/ros/callbacks.py", line 33, in call
    callback(*arguments)
  File "/package/src/mlsm_manager/ros/node.py", line 71, in _take
    raise ValueError("no block 7")
ValueError: no block 7
"""
OF_A_THREAD = LOGGED.replace("node.py", "saving.py").replace("line 71", "line 12").replace("block 7", "room")
HEALTHY = "[INFO] [1606204595.1, 12.0]: map saved\n[ERROR-free-1] process has finished cleanly\n"


def test_a_run_without_errors_is_told_nothing():
    assert list(of_errors({}, [], HEALTHY)) == []


def test_internal_errors_of_a_stage_fail_the_run_and_name_it():
    (row,) = of_errors({"mlsm_core": 3}, [], HEALTHY)
    assert (row.what, row.measured, row.holds) == ("mlsm_core: internal errors in /diagnostics", "3", False)


def test_a_logged_traceback_fails_the_run_once_and_names_node_and_line():
    printed = f"{HEALTHY}\x1b[31m[ERROR] [1606204596.2, 13.0]: {LOGGED}\x1b[0m\n{HEALTHY}"
    (row,) = of_errors({}, [("/mlsm_core", LOGGED), ("/mlsm_core", LOGGED)], printed)
    assert row.what == "/mlsm_core: error"
    assert row.measured == 'File "/package/src/mlsm_manager/ros/node.py", line 71 ValueError: no block 7'
    assert not row.holds


def test_a_traceback_that_a_thread_printed_beside_the_log_fails_the_run():
    (row,) = of_errors({}, [], f"{HEALTHY}Exception in thread Thread-5:\n{OF_A_THREAD}{HEALTHY}")
    assert row.measured == 'File "/package/src/mlsm_manager/ros/saving.py", line 12 ValueError: no room'
    assert not row.holds


def test_a_node_that_ended_fails_the_run():
    died = "\x1b[31m[mlsm_core-4] process has died [pid 71, exit code 1, cmd /package/nodes/mlsm_core].\n"
    (row,) = of_errors({}, [], HEALTHY + died)
    assert "mlsm_core-4] process has died [pid 71, exit code 1" in row.measured
    assert not row.holds
