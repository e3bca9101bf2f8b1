"""Computes the chapters and sections that were asked for, all of them when none was."""

import argparse
import resource
import sys
from typing import List, Tuple

from benchmarks.harness import ROOT, recorded

from thesis_results import consistency, marina, moves, moving, processing, settings, sonar, survey
from thesis_results.page import Section, joined, made_with, write_page
from thesis_results.pictures import Pictures

PAGE = ROOT / "docs/results.md"
PICTURES = ROOT / "docs/pictures/results"
SECTIONS: Tuple[Section, ...] = (
    Section("settings", "7", "The thesis's settings beside ours", settings.make),
    Section("simulation", "7.1", "Simulated scans", sonar.make_simulated),
    Section("852", "7.1", "An Imagenex 852, emulated from bytes", sonar.make_852),
    Section("recorded", "7.1", "Simulated and recorded scans", sonar.make_recorded, sonar.RECORDINGS),
    Section("processing", "7.2", "A simulated scan, cleaned", processing.make_simulated),
    Section("processing-recorded", "7.2", "A recorded scan, cleaned", processing.make_recorded, (sonar.TANK,)),
    Section("mapping", "7.3", "A 3-D survey of the harbour", survey.make),
    Section("moves", "7.4", "Three moves with an odometry that is 30 % off", moves.make),
    Section("moving", "7.4", "A vehicle that never stops", moving.make),
    Section("marina", "7.4", "A real marina", marina.make, marina.RECORDINGS),
    Section("compass", "7.4", "The marina with the compass alone", marina.make_compass_alone, marina.RECORDINGS),
    Section("consistency", "beyond", "Are the stated deviations true?", consistency.make),
)
"""All sections of the page, in its order; a new one is one line here."""


def main() -> None:
    """Write the page after each section, so that one that fails costs nothing of the others."""
    words = [section.word for section in SECTIONS]
    chapters = sorted({section.chapter for section in SECTIONS})
    parser = argparse.ArgumentParser(prog="scripts/results", description=__doc__)
    parser.add_argument("chosen", nargs="*", metavar="CHAPTER", help=f"chapters ({', '.join(chapters)}) or sections "
                        f"({', '.join(words)})")  # fmt: skip
    chosen: List[str] = parser.parse_args().chosen
    unknown = set(chosen) - set().union(*(section.names for section in SECTIONS))
    if unknown:
        parser.error(f"{', '.join(sorted(unknown))}: must be among {', '.join([*chapters, *words])}")
    for section in SECTIONS:
        if not chosen or section.names & set(chosen):
            _write(section)


def _write(section: Section) -> None:
    missing = [name for name in section.recordings if not recorded(name).is_file()]
    if missing:
        print(f"{section.heading}: left as it is, {', '.join(missing)} not in {recorded('')}; set UMC_DATA",
              file=sys.stderr)  # fmt: skip
        return
    start = _busy()
    body = section.make(Pictures(PICTURES, PAGE))
    seconds = _busy() - start
    write_page(PAGE, SECTIONS, {section.heading: joined(body, made_with(seconds))})
    print(f"{section.heading}: {seconds:.0f} s of CPU time", flush=True)


def _busy() -> float:
    """Return the CPU time [s] of this process and of those that it started and that have ended."""
    usages = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(usage.ru_utime + usage.ru_stime for usage in usages)


if __name__ == "__main__":
    main()
