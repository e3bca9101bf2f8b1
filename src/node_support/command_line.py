"""Command lines whose help may be cut short by its reader, as in `map_bag --help | head -1`."""

import argparse
import signal
import sys
from typing import IO, Optional


class CommandLine(argparse.ArgumentParser):
    """An ArgumentParser that ends quietly when nobody reads the rest of its help."""

    def print_help(self, file: Optional[IO[str]] = None) -> None:
        """Print the help on `file`, standard output unless told otherwise."""
        write_help(self.format_help().rstrip("\n"), file or sys.stdout)


def write_help(text: str, file: IO[str]) -> None:
    """Write a text and flush it; a closed pipe ends the process without a word, as it ends other Unix programs.

    Python ignores the signal otherwise, which nodes need for their sockets.
    """
    before = signal.signal(signal.SIGPIPE, signal.SIG_DFL)
    try:
        print(text, file=file, flush=True)
    finally:
        signal.signal(signal.SIGPIPE, before)
