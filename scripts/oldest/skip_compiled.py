"""A pytest plugin that skips the test files that import a compiled module of ROS, directly or through others."""

from typing import Generator

import pytest
from ros_modules import CompiledModuleError


@pytest.hookimpl(hookwrapper=True)
def pytest_make_collect_report(collector: pytest.Collector) -> Generator:
    """Make a skipped file of one that cannot be collected because of a CompiledModuleError."""
    outcome = yield
    report = outcome.get_result()
    missing = _missing(report)
    if missing is not None:
        report.outcome, report.longrepr = "skipped", (str(collector.path), 0, f"Skipped: {missing}")


def _missing(report: pytest.CollectReport) -> object:
    error = report.call.excinfo.value if report.failed and report.call.excinfo else None
    while error is not None and not isinstance(error, CompiledModuleError):
        error = error.__cause__ or error.__context__
    return error
