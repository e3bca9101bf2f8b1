"""map_bag as it is run: with a command line, and what it leaves and says."""

import json

from programs import run_program


def run(*arguments):
    return run_program("map_bag", *arguments)


def refused(*arguments):
    """Return the one line with which map_bag refuses."""
    done = run(*arguments)
    lines = done.stderr.strip().splitlines()
    assert (done.returncode, len(lines)) == (1, 1), done.stderr
    return lines[0]


def summary_of(folder):
    return json.loads((folder / "summary.json").read_text())
