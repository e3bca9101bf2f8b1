"""Prints figures of the package on this machine as a table, those of all sections when none was asked for.

scripts/bench STUDY measures what takes longer, with options of its own (scripts/bench STUDY --help).
"""

import argparse
import sys
from functools import partial
from importlib import import_module
from typing import Callable, Dict, List

from benchmarks import chain_figures, map_bag_figures, map_figures, matching_figures, shape_figures, simulation_figures
from benchmarks.harness import Row, print_table

SECTIONS: Dict[str, Callable[[], List[Row]]] = {
    "map": map_figures.rows,
    "large-map": map_figures.large_rows,
    "carving": map_bag_figures.carving_rows,
    "map-bag": map_bag_figures.rows,
    "matching": matching_figures.rows,
    "chain": chain_figures.rows,
    "shapes": shape_figures.rows,
    "simulation": simulation_figures.rows,
}
STUDIES = (
    "autopilot",
    "canals",
    "chart",
    "faults",
    "heads",
    "honest",
    "link",
    "live_faults",
    "logs",
    "long_run",
    "lost",
    "no_parameters",
    "page_link",
    "silence",
    "web",
    "workers",
)


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
    sections = {**SECTIONS, "matching": partial(matching_figures.rows, arguments.first_seed)}
    print_table([row for name in arguments.chosen or list(SECTIONS) for row in sections[name]()])


if __name__ == "__main__":
    main()
