"""A pytest plugin that runs one case of each test and skips what needs a compiled module of ROS: test files that import
one, directly or through others, and tests whose child process ends because it imports one."""

import subprocess
from typing import Dict, Generator, List, Optional

import pytest
from ros_modules import CompiledModuleError


def pytest_collection_modifyitems(items: List[pytest.Item]) -> None:
    """Keep the first case of each parametrised test: what an old version lacks, every case needs."""
    first: Dict[str, pytest.Item] = {}
    for item in items:
        first.setdefault(item.nodeid.partition("[")[0], item)
    items[:] = first.values()


@pytest.hookimpl(hookwrapper=True)
def pytest_make_collect_report(collector: pytest.Collector) -> Generator:
    """Make a skipped file of one that cannot be collected because of a CompiledModuleError."""
    outcome = yield
    _skip(outcome.get_result(), collector.path, outcome.get_result().call)


@pytest.hookimpl(hookwrapper=True)
def pytest_runtest_makereport(item: pytest.Item, call: pytest.CallInfo) -> Generator:
    """Make a skipped test of one that fails because of a CompiledModuleError, here or in a child process."""
    outcome = yield
    _skip(outcome.get_result(), item.path, call)


def _skip(report: object, path: object, call: Optional[pytest.CallInfo]) -> None:
    error = call.excinfo.value if report.failed and call and call.excinfo else None
    missing = _missing(error)
    if missing is not None:
        report.outcome, report.longrepr = "skipped", (str(path), 0, f"Skipped: {missing}")


def _missing(error: Optional[BaseException]) -> Optional[str]:
    while error is not None:
        if isinstance(error, CompiledModuleError):
            return str(error)
        if isinstance(error, subprocess.CalledProcessError) and isinstance(error.stderr, str):
            last = (error.stderr.strip().splitlines() or [""])[-1]
            return last.partition(": ")[2] if last.startswith("ros_modules.CompiledModuleError: ") else None
        error = error.__cause__ or error.__context__
    return None
