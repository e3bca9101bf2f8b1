"""Computes the chapters and sections that were asked for, all of them when none was."""

import argparse
import resource
import sys
from typing import List

from benchmarks.recorded import recorded

from thesis_results.made_with import ROOT, made_with
from thesis_results.markdown import joined
from thesis_results.page import write_page
from thesis_results.pictures import Pictures
from thesis_results.section import Section
from thesis_results.section_table import SECTIONS

PAGE = ROOT / "docs/results.md"
PICTURES = ROOT / "docs/pictures/results"


def main() -> None:
    """Write the page after each section, so that one that fails costs nothing of the others."""
    words = [section.word for section in SECTIONS]
    chapters = sorted({section.chapter for section in SECTIONS})
    parser = argparse.ArgumentParser(prog="scripts/results", description=__doc__)
    parser.add_argument("chosen", nargs="*", metavar="CHAPTER", help=f"chapters ({', '.join(chapters)}) or sections "
                        f"({', '.join(words)})")  # fmt: skip
    chosen: List[str] = parser.parse_args().chosen
    unknown = set(chosen) - {*words, *chapters}
    if unknown:
        parser.error(f"{', '.join(sorted(unknown))}: must be among {', '.join([*chapters, *words])}")
    for section in SECTIONS:
        if not chosen or {section.word, section.chapter} & set(chosen):
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
