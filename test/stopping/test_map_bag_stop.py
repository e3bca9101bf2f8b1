"""Ctrl-C ends map_bag within two seconds, whatever it is doing."""

import os
import pty
import signal
import subprocess
import sys
import time

from stopwatch import ROOT

COMMAND = [sys.executable, str(ROOT / "nodes/map_bag"), str(ROOT / "test/data/basin.bag"), "--refine"]


def test_ctrl_c_ends_it_within_two_seconds_and_leaves_nothing(tmp_path):
    """Another program may take the processor during one attempt."""
    assert any(seconds_to_end(tmp_path) < 2.0 for _ in range(5))
    assert list(tmp_path.iterdir()) == []


def seconds_to_end(out):
    """Return how long map_bag takes to end after Ctrl-C while it matches scans, s."""
    terminal, end = pty.openpty()
    # Tests that a shell runs in the background would hand on that Ctrl-C is ignored.
    process = subprocess.Popen(
        [*COMMAND, "--out", str(out)],
        stderr=end, preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    )  # fmt: skip
    shown = b""
    while b"match" not in shown:
        shown += os.read(terminal, 4096)
    process.send_signal(signal.SIGINT)
    start = time.monotonic()
    assert process.wait(timeout=60) == 1
    seconds = time.monotonic() - start
    os.close(terminal)
    os.close(end)
    return seconds
