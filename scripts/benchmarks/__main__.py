"""Prints figures of the package on this machine as a table, those of all sections when none was asked for.

scripts/bench STUDY measures what takes longer, with options of its own (scripts/bench STUDY --help).
"""

import argparse
import sys
from importlib import import_module
from typing import List

from benchmarks.harness import Row, print_table

SECTIONS = {
    "large-map": "map_figures.rows", "carving": "carving_figures.rows",
    "matching": "matching_figures.rows", "chain": "chain_figures.rows",
    "shapes": "shape_figures.rows", "simulation": "simulation_figures.rows",
}  # fmt: skip
"""Names of the functions that return their rows: a study need not import what it does not use."""
STUDIES = (
    "autopilot", "canals", "chart", "faults", "heads", "honest", "link", "live_faults", "logs", "long_run", "lost",
    "no_parameters", "page_link", "silence", "web", "workers",
)  # fmt: skip


def main() -> None:
    """Print one table, or run a study."""
    study = "".join(sys.argv[1:2]).lstrip("-").replace("-", "_")
    if study in STUDIES:
        sys.argv.pop(1)
        import_module(f"benchmarks.{study}").main()
        return
    parser = argparse.ArgumentParser(
        "scripts/bench", description=__doc__, epilog=f"STUDY: {', '.join(STUDIES)}",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )  # fmt: skip
    for name in SECTIONS:
        parser.add_argument(f"--{name}", action="append_const", const=name, dest="chosen", help=f"figures of {name}")
    parser.add_argument("--first-seed", type=int, default=0, help="of --matching: other seeds than the published ones")
    arguments = parser.parse_args()
    print_table([row for name in arguments.chosen or SECTIONS for row in section_rows(name, arguments.first_seed)])


def section_rows(name: str, first_seed: int = 0) -> List[Row]:
    """Compute the figures of a section; first_seed: of those that are drawn at random."""
    file, _, function = SECTIONS[name].partition(".")
    rows = getattr(import_module(f"benchmarks.{file}"), function)
    return rows(first_seed) if name == "matching" else rows()


if __name__ == "__main__":
    main()
