"""The command line of a benchmark that is a program of its own."""

import argparse


def benchmark_parser(name: str, description: str) -> argparse.ArgumentParser:
    """Return a parser for `python3 -m benchmarks.NAME`; description: the program's docstring."""
    return argparse.ArgumentParser(
        prog=f"python3 -m benchmarks.{name}",
        description=description,
        epilog="Run it in the folder scripts, after: source scripts/env.bash",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
