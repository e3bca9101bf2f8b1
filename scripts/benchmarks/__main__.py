"""Prints the figures of the sections that were asked for, all of them when none was."""

import argparse
from functools import partial
from typing import Callable, Dict, List

from benchmarks import (
    carving_figures,
    compiled_chain,
    compiled_threshold,
    growth_figures,
    large_map_figures,
    map_bag_figures,
    map_figures,
    marina_figures,
    matching_figures,
    other_libraries,
    other_registrations,
    processing_figures,
    shape_figures,
    simulation_figures,
    survey_figures,
    tour_figures,
    vehicle_figures,
)
from benchmarks.table import Row, print_table

SECTIONS: Dict[str, Callable[[], List[Row]]] = {
    "growth": growth_figures.rows,
    "map": map_figures.rows,
    "large-map": large_map_figures.rows,
    "carving": carving_figures.rows,
    "map-bag": map_bag_figures.rows,
    "marina": marina_figures.rows,
    "matching": matching_figures.rows,
    "chain": compiled_chain.rows,
    "others": lambda: compiled_threshold.rows() + other_libraries.rows() + other_registrations.rows(),
    "processing": processing_figures.rows,
    "simulation": simulation_figures.rows,
    "vehicle": vehicle_figures.rows,
    "shapes": shape_figures.rows,
    "survey": survey_figures.rows,
    "tours": tour_figures.rows,
}


def main() -> None:
    """Print one table."""
    parser = argparse.ArgumentParser(prog="scripts/bench", description=__doc__)
    for name in SECTIONS:
        parser.add_argument(f"--{name}", action="append_const", const=name, dest="chosen", help=f"figures of {name}")
    parser.add_argument("--first-seed", type=int, default=0, help="of --matching: other seeds than the published ones")
    arguments = parser.parse_args()
    sections = {**SECTIONS, "matching": partial(matching_figures.rows, arguments.first_seed)}
    print_table([row for name in arguments.chosen or list(SECTIONS) for row in sections[name]()])


if __name__ == "__main__":
    main()
