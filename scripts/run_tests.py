"""Runs lint, unit tests and rostests, and adds up what passed and what failed."""

import os
import subprocess
import sys
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Callable, List, Optional
from xml.etree import ElementTree as ET

from oldest.environment import HOW_TO_GET_ONE, find_python38

ROOT = Path(__file__).resolve().parent.parent
RESULTS = ROOT / "build/test_results"
STEP_TIMEOUT = 400.0
# Downloads 100 MB.
ENVIRONMENT_TIMEOUT = 1200.0
# Rostests mostly wait; each has a master of its own. With more at once, two cores no longer answer in time.
TOGETHER = 2
# Rostests that measure time, or whose simulation or playback runs as fast as a whole processor allows.
ALONE = (
    "compass_demo",
    "imagenex_852_load",
    "marina",
    "matching_many_processes",
    "matching_one_process",
    "micron_scan_line",
    "micron_tank",
    "one_and_many_processes",
    "ping360_load",
    "play_bag",
    "play_old_bag",
    "simulator_commands",
    "simulator_demo",
    "standing",
    "vehicle",
)
ROSTEST_TRIES = 1
_PRINTING = threading.Lock()


@dataclass(frozen=True)
class Outcome:
    """What one step counted."""

    passed: int
    failed: int
    skipped: int = 0


@dataclass(frozen=True)
class Step:
    """One command and how its result is counted.

    report: the JUnit file, or the folder of such files, that it leaves. is_alone: nothing else may run meanwhile.
    tries: how often it is run at most, until it passes.
    """

    name: str
    command: List[str]
    report: Optional[Path] = None
    timeout: float = STEP_TIMEOUT
    is_alone: bool = True
    tries: int = 1


def steps() -> List[Step]:
    """Return all steps, those that run alone with quick ones first."""
    unit_report, recordings_report = RESULTS / "unit.xml", RESULTS / "recordings.xml"
    installation_report, stopping_report = RESULTS / "installation.xml", RESULTS / "stopping.xml"
    plain = RESULTS / "without_ros.xml"
    pytest = ["python3", "-m", "pytest"]
    found = [
        Step("ruff check", ["ruff", "check", "--quiet", "."]),
        Step("ruff format", ["ruff", "format", "--quiet", "--check", "."]),
        Step("catkin_lint", ["catkin_lint", "--strict", "-W1", "--offline", "."]),
        Step("unit tests", [*pytest, "-n", "auto", "--dist", "loadfile", f"--junitxml={unit_report}"], unit_report),
        Step(
            "recordings",
            [*pytest, "test/recordings", f"--junitxml={recordings_report}"],
            recordings_report,
            is_alone=False,
        ),
        *oldest_versions(),
        Step("installation", [*pytest, "test/installation", f"--junitxml={installation_report}"], installation_report),
        Step("without ROS", [*pytest, "test/without_ros", f"--junitxml={plain}"], plain, ENVIRONMENT_TIMEOUT),
        Step("stopping", [*pytest, "test/stopping", f"--junitxml={stopping_report}"], stopping_report),
    ]
    for test in sorted((ROOT / "test/rostest").glob("*.test")):
        folder = RESULTS / test.stem
        command = ["rostest", "--results-filename=result.xml", str(test)]
        found.append(Step(f"rostest {test.stem}", command, folder, is_alone=test.stem in ALONE, tries=ROSTEST_TRIES))
    return found


def oldest_versions() -> List[Step]:
    """Return the steps of the unit tests with the oldest versions, none where no Python 3.8 is found."""
    if find_python38() is None:
        print(f"       left out: oldest versions: {HOW_TO_GET_ONE}", flush=True)
        return []
    report = RESULTS / "oldest.xml"
    command = ["python3", "scripts/oldest/run.py", "-n", "auto", "--dist", "loadfile", f"--junitxml={report}"]
    environment = ["python3", "scripts/oldest/environment.py"]
    return [
        Step("oldest versions: environment", environment, timeout=ENVIRONMENT_TIMEOUT),
        Step("oldest versions: unit tests", command, report),
    ]


def run_step(step: Step) -> Outcome:
    """Run a step, print what failed and return its counts; it has failed when all of its tries have."""
    for left in reversed(range(step.tries)):
        outcome = _tried(step)
        if not outcome.failed:
            break
        if left:
            print(f"AGAIN  {step.name}: the first try failed, see above", flush=True)
    return outcome


def _tried(step: Step) -> Outcome:
    start = time.monotonic()
    environment = {**os.environ, "ROS_TEST_RESULTS_DIR": str(step.report or RESULTS)}
    try:
        done = subprocess.run(
            step.command, cwd=str(ROOT), env=environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
            stdin=subprocess.DEVNULL, timeout=step.timeout, check=False,
        )  # fmt: skip
        status, output = done.returncode, done.stdout.decode(errors="replace")
    except subprocess.TimeoutExpired as expired:
        status, output = 1, f"{(expired.stdout or b'').decode(errors='replace')}\nno end after {step.timeout:.0f} s"
    outcome = _counted(step, status)
    with _PRINTING:
        print("\n".join(_told(step, outcome, output, time.monotonic() - start)), flush=True)
    return outcome


def _told(step: Step, outcome: Outcome, output: str, seconds: float) -> List[str]:
    failures = [output.rstrip(), *_failure_texts(step)] if outcome.failed else []
    skipped = f", {outcome.skipped} skipped" if outcome.skipped else ""
    counts = f"{outcome.passed} passed, {outcome.failed} failed{skipped} ({seconds:.1f} s)"
    reasons = [f"       skipped: {reason}" for reason in _skip_reasons(step)] if outcome.skipped else []
    return [*failures, f"{'FAILED' if outcome.failed else 'ok':6} {step.name}: {counts}", *reasons]


def _counted(step: Step, status: int) -> Outcome:
    if step.report is None:
        return Outcome(int(status == 0), int(status != 0))
    cases = _cases(step.report)
    failed = sum(1 for case in cases if case.find("failure") is not None or case.find("error") is not None)
    skipped = sum(1 for case in cases if case.find("skipped") is not None)
    passed = len(cases) - failed - skipped
    # A step that broke before, after or without its tests has failed, whatever the tests say.
    return Outcome(passed, max(failed, int(status != 0 or not cases)), skipped)


def _cases(report: Path) -> List[ET.Element]:
    files = [report] if report.is_file() else sorted(report.rglob("rosunit-*.xml"))
    return [case for file in files for case in _root(file).iter("testcase")]


def _root(report: Path) -> ET.Element:
    """Return the content of a report, nothing where its test was ended while it wrote."""
    try:
        return ET.parse(str(report)).getroot()
    except ET.ParseError:
        return ET.Element("testsuites")


def _failure_texts(step: Step) -> List[str]:
    cases = _cases(step.report) if step.report else []
    return [element.text or "" for case in cases for kind in ("failure", "error") for element in case.findall(kind)]


def _skip_reasons(step: Step) -> List[str]:
    found = [case.find("skipped") for case in _cases(step.report)] if step.report else []
    return sorted({_skip_reason(element) for element in found if element is not None})


def _skip_reason(element: ET.Element) -> str:
    """Return the reason of a skipped test, or of a skipped file: pytest gives that one in a tuple's repr."""
    message, text = element.get("message") or "", element.text or ""
    return text.rpartition("Skipped: ")[2].strip("\"')") if message == "collection skipped" else message or text


def main(words: List[str], run: Callable[[Step], Outcome] = run_step) -> int:
    """Run the steps whose names contain one of `words` (all without words); return the exit status."""
    subprocess.run(["rm", "-rf", str(RESULTS)], check=True)
    RESULTS.mkdir(parents=True)
    chosen = [step for step in steps() if not words or any(word in step.name for word in words)]
    outcomes = [run(step) for step in chosen if step.is_alone]
    with ThreadPoolExecutor(max_workers=TOGETHER) as pool:
        outcomes += pool.map(run, [step for step in chosen if not step.is_alone])
    passed, failed = sum(o.passed for o in outcomes), sum(o.failed for o in outcomes)
    print(f"{passed} passed, {failed} failed")
    return int(failed > 0 or passed == 0)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
