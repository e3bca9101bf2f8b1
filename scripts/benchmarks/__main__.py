"""Prints figures of the package on this machine: those of all quick benches when none was asked for.

scripts/bench NAME [OPTIONS] runs a bench; scripts/bench NAME --help lists its options. Names may be written --NAME.
"""

import argparse
import inspect
import sys
from importlib import import_module
from itertools import takewhile
from pathlib import Path
from typing import Any, Callable, Dict, List

from benchmarks.harness import SkippedError, print_rows
from recordings.bags.bag import RecordingError

QUICK = {
    "large_map": "map_figures.rows",
    "carving": "map_figures.carving_rows",
    "matching": "matching_figures.rows",
    "chain": "map_figures.chain_rows",
    "shapes": "shape_figures.rows",
    "simulation": "simulation_figures.rows",
}
"""The function of each bench: it returns a table, or yields lines. Its arguments are the options."""
BENCHES = {
    **QUICK,
    "autopilot": "autopilot.rows",
    "canals": "canals.lines",
    "chart": "chart.rows",
    "faults": "faults.lines",
    "heads": "heads.lines",
    "honest": "honest.lines",
    "link": "link.rows",
    "live_faults": "live_faults.lines",
    "logs": "logs.lines",
    "long_run": "long_run.lines",
    "lost": "lost.lines",
    "no_parameters": "no_parameters.lines",
    "page_link": "page_link.rows",
    "silence": "silence.lines",
    "web": "web.rows",
    "workers": "workers.lines",
}


def function_of(name: str) -> Callable[..., Any]:
    """Return the function of a bench. No bench imports what another one needs."""
    module, _, function = BENCHES[name].partition(".")
    return getattr(import_module(f"benchmarks.{module}"), function)


def options_of(name: str, bench: Callable[..., Any], words: List[str]) -> Dict[str, Any]:
    """Return the arguments of a bench from the command line: options, and paths where there is no default."""
    about = f"{sys.modules[bench.__module__].__doc__}\n{inspect.getdoc(bench)}"
    parser = argparse.ArgumentParser(
        f"scripts/bench {name}", description=about, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    for one in inspect.signature(bench).parameters.values():
        option, default = f"--{one.name.strip('_').replace('_', '-')}", one.default
        kind = getattr(one.annotation, "__args__", [one.annotation])[0]
        if default is one.empty:
            parser.add_argument(one.name, nargs="+", type=Path)
        elif kind is bool:
            parser.add_argument(option, dest=one.name, action="store_true")
        else:
            several = "+" if isinstance(default, tuple) else None
            told = {"default": default, "help": "default: %(default)s"}
            parser.add_argument(option, dest=one.name, type=kind, nargs=several, **told)
    return vars(parser.parse_args(words))


def main() -> None:
    """Run the benches that were asked for."""
    parser = argparse.ArgumentParser(
        "scripts/bench", usage="%(prog)s [NAME ...] [OPTIONS]", description=__doc__,
        epilog=f"NAME: {', '.join(BENCHES)}; quick: {', '.join(QUICK)}",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )  # fmt: skip
    names = (word.lstrip("-").replace("-", "_") for word in sys.argv[1:])
    chosen = list(takewhile(BENCHES.__contains__, names))
    words = sys.argv[1 + len(chosen) :]
    if not chosen:
        parser.parse_args(words)
    for name in chosen or QUICK:
        bench = function_of(name)
        options = options_of(name, bench, words)
        try:
            print_rows(bench(**options))
        except (RecordingError, SkippedError) as missing:
            print(f"{name}: skipped: {missing}")


if __name__ == "__main__":
    main()
