"""Runs lint, unit tests and rostests, and adds up what passed and what failed."""

import os
import subprocess
import sys
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from enum import Enum
from pathlib import Path
from typing import Callable, Iterable, List, Mapping, Optional
from xml.etree import ElementTree as ET

from oldest.environment import HOW_TO_GET_ONE, find_python38

ROOT = Path(__file__).resolve().parent.parent
RESULTS = ROOT / "build/test_results"
# s: longer than any test waits for an event that does not come.
STEP_TIMEOUT = 1200.0
# s: downloads 100 MB, or computes with what the others leave, on a machine that is three times slower than most.
SPARE_TIMEOUT = 3600.0
# Rostests mostly wait; each has a master of its own.
TOGETHER = 3
# Spare steps at once: as many as leave no processor idle while the others wait, also where one of them waits itself.
SPARE_TOGETHER = 3
# The lowest there is: who waits for a message gets the processor at once.
SPARE_PRIORITY = 19
# Rostests that measure processor time; all others wait for what must come, however late.
MEASURING = ("imagenex_852_load", "ping360_load")
# Rostests, and files of long tests, that take longest, by their stems: those that begin last should be short.
LONG = (
    "vehicle_emulated", "every_node", "standing_head", "one_and_many_processes", "bad_input", "silence",
    "test_causes", "test_motion_faults", "test_sonar_faults", "test_map_bag", "test_each", "test_found_after_silence",
)  # fmt: skip
# Of pytest: a file's tests share what its fixtures made. Each process first imports everything, which takes seconds:
# only the steps that take longest do it twice.
IN_PARALLEL = ("-n", str(os.cpu_count() or 1), "--dist", "loadfile")
_PRINTING = threading.Lock()


@dataclass(frozen=True)
class Outcome:
    """What one step counted."""

    passed: int
    failed: int
    skipped: int = 0


class Load(Enum):
    """What a step asks of the machine."""

    ALONE = "is quick: nothing else runs"
    WHOLE = "uses all processors or measures time: only SPARE ones may run beside it"
    SHARED = "mostly waits: some run at once"
    SPARE = "computes and measures no time: takes what all others leave"


@dataclass(frozen=True)
class Step:
    """One command and how its result is counted.

    report: the JUnit file, or the folder of such files, that it leaves. variables: added to its environment.
    """

    name: str
    command: List[str]
    report: Optional[Path] = None
    load: Load = Load.WHOLE
    timeout: float = STEP_TIMEOUT
    variables: Mapping[str, str] = field(default_factory=dict)


def steps() -> List[Step]:
    """Return all steps, of each load in the order in which they begin: long ones before short ones."""
    return [
        Step("ruff check", ["ruff", "check", "--quiet", "."], load=Load.ALONE),
        Step("ruff format", ["ruff", "format", "--quiet", "--check", "."], load=Load.ALONE),
        _pytest("unit tests", "test/unit", "-m", "not long", *IN_PARALLEL),
        _pytest("stopping", "test/stopping/test_stop.py"),
        *oldest_versions(),
        _pytest("without ROS", "test/without_ros", load=Load.SPARE),
        _pytest("long tests", *_long(), "-m", "long", *IN_PARALLEL, load=Load.SPARE),
        _pytest("recordings", "test/recordings", load=Load.SPARE),
        _pytest("documentation", "test/documentation", load=Load.SPARE),
        _damaged_files(),
        Step("catkin_lint", ["catkin_lint", "--strict", "-W1", "--offline", "."], load=Load.SPARE),
        _pytest("master restart", "test/stopping/test_master_restart.py", load=Load.SHARED),
        _pytest("web page", "test/stopping/test_web_page.py", load=Load.SHARED),
        _pytest("installation", "test/installation", load=Load.SHARED),
        _pytest("soak", "test/soak", load=Load.SHARED),
        *(_rostest(test) for test in _longest_first((ROOT / "test/rostest").glob("*.test"))),
    ]


def _damaged_files() -> Step:
    """Return the step of scripts/fuzz, with few of its damages."""
    command = ["python3", "-m", "fuzz_files", "--files", "--mutations", "5"]
    variables = {"PYTHONPATH": f"{ROOT / 'scripts'}:{os.environ['PYTHONPATH']}", "OPENBLAS_NUM_THREADS": "1"}
    return Step("damaged files", command, load=Load.SPARE, timeout=SPARE_TIMEOUT, variables=variables)


def _longest_first(files: Iterable[Path]) -> List[Path]:
    order = {stem: number for number, stem in enumerate(LONG)}
    return sorted(files, key=lambda path: (order.get(path.stem, len(LONG)), path.stem))


def _long() -> List[str]:
    """Return the files with long tests: to import all others takes seconds."""
    files = (ROOT / "test/unit").rglob("test_*.py")
    return [str(path) for path in _longest_first(files) if "mark.long" in path.read_text()]


def _pytest(name: str, *arguments: str, load: Load = Load.WHOLE) -> Step:
    report = RESULTS / f"{name.replace(' ', '_')}.xml"
    command = ["python3", "-m", "pytest", *arguments, f"--junitxml={report}"]
    return Step(name, command, report, load, SPARE_TIMEOUT if load is Load.SPARE else STEP_TIMEOUT)


def _rostest(test: Path) -> Step:
    command = ["rostest", "--results-filename=result.xml", str(test)]
    load = Load.WHOLE if test.stem in MEASURING else Load.SHARED
    # Nodes of one name that run at once would save their maps in one file.
    # roslaunch asks for distutils; setuptools, which would lend its own, takes as long to import as all of roslaunch.
    variables = {"ROS_HOME": str(RESULTS / test.stem / "ros_home"), "SETUPTOOLS_USE_DISTUTILS": "stdlib"}
    return Step(f"rostest {test.stem}", command, RESULTS / test.stem, load, variables=variables)


def oldest_versions() -> List[Step]:
    """Return the step of the unit tests with the oldest versions, none where no Python 3.8 is found."""
    if find_python38() is None:
        print(f"       left out: oldest versions: {HOW_TO_GET_ONE}", flush=True)
        return []
    report = RESULTS / "oldest.xml"
    command = ["python3", "scripts/oldest/run.py", f"--junitxml={report}"]
    return [Step("oldest versions", command, report, Load.SPARE, SPARE_TIMEOUT)]


def run_step(step: Step) -> Outcome:
    """Run a step, print what failed and return its counts."""
    start = time.monotonic()
    environment = {**os.environ, "ROS_TEST_RESULTS_DIR": str(step.report or RESULTS), **step.variables}
    command = ["nice", f"-n{SPARE_PRIORITY}", *step.command] if step.load is Load.SPARE else step.command
    try:
        done = subprocess.run(
            command, cwd=str(ROOT), env=environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
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
    texts = [element.text or "" for kind in ("failure", "error") for element in _found(step, kind)]
    failures = [output.rstrip(), *texts] if outcome.failed else []
    skipped = f", {outcome.skipped} skipped" if outcome.skipped else ""
    counts = f"{outcome.passed} passed, {outcome.failed} failed{skipped} ({seconds:.1f} s)"
    reasons = sorted({_skip_reason(element) for element in _found(step, "skipped")})
    told = f"{'FAILED' if outcome.failed else 'ok':6} {step.name}: {counts}"
    return [*failures, told, *(f"       skipped: {reason}" for reason in reasons)]


def _counted(step: Step, status: int) -> Outcome:
    if step.report is None:
        return Outcome(int(status == 0), int(status != 0))
    cases = len(_cases(step.report))
    failed, skipped = len(_found(step, "failure")) + len(_found(step, "error")), len(_found(step, "skipped"))
    # A step that broke before, after or without its tests has failed, whatever the tests say.
    return Outcome(max(cases - failed - skipped, 0), max(failed, int(status != 0 or not cases)), skipped)


def _found(step: Step, kind: str) -> List[ET.Element]:
    """Return what a step's tests said of one kind: failure, error or skipped."""
    return [element for case in _cases(step.report) for element in case.findall(kind)] if step.report else []


def _cases(report: Path) -> List[ET.Element]:
    files = [report] if report.is_file() else sorted(report.rglob("rosunit-*.xml"))
    return [case for file in files for case in _root(file).iter("testcase")]


def _root(report: Path) -> ET.Element:
    """Return the content of a report, nothing where its test was ended while it wrote."""
    try:
        return ET.parse(str(report)).getroot()
    except ET.ParseError:
        return ET.Element("testsuites")


def _skip_reason(element: ET.Element) -> str:
    """Return the reason of a skipped test, or of a skipped file: pytest gives that one in a tuple's repr."""
    message, text = element.get("message") or "", element.text or ""
    return text.rpartition("Skipped: ")[2].strip("\"')") if message == "collection skipped" else message or text


def main(words: List[str], run: Callable[[Step], Outcome] = run_step) -> int:
    """Run the steps whose names contain one of `words` (all without words); return the exit status."""
    chosen = [step for step in steps() if not words or any(word in step.name for word in words)]
    if not chosen:
        print(f"usage: scripts/test [NAME ...], parts of these names: {', '.join(step.name for step in steps())}")
        return 2
    subprocess.run(["rm", "-rf", str(RESULTS)], check=True)
    RESULTS.mkdir(parents=True)
    outcomes = [run(step) for step in chosen if step.load is Load.ALONE]
    with ThreadPoolExecutor(TOGETHER) as shared, ThreadPoolExecutor(SPARE_TOGETHER) as spare:
        running = [spare.submit(run, step) for step in chosen if step.load is Load.SPARE]
        outcomes += [run(step) for step in chosen if step.load is Load.WHOLE]
        running += [shared.submit(run, step) for step in chosen if step.load is Load.SHARED]
    outcomes += [one.result() for one in running]
    passed, failed = sum(o.passed for o in outcomes), sum(o.failed for o in outcomes)
    print(f"{passed} passed, {failed} failed")
    return int(failed > 0 or passed == 0)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
