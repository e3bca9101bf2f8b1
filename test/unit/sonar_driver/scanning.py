"""A driver that scans in a thread."""

import threading
import time

from sonar_driver.line.device import Scanner

PATIENCE = 60.0
_POLL = 0.01


class Scanning:
    """A scanner in a thread, with the pings it delivered."""

    def __init__(self, device, command):
        self.pings = []
        self.device = device
        self.scanner = Scanner(device, command, self._note)
        self._news = threading.Condition()
        self._thread = threading.Thread(target=self.scanner.run, daemon=True)

    def __enter__(self):
        self.scanner.connect()
        self._thread.start()
        return self

    def __exit__(self, *exception):
        self.stop()

    @property
    def stats(self):
        return self.device.stats

    @property
    def angles(self):
        return [ping.beam.angle for ping in self.pings]

    def stop(self, timeout=PATIENCE):
        """Stop; return whether the thread ended in time."""
        self.device.stop.set()
        self._thread.join(timeout)
        return not self._thread.is_alive()

    def wait(self, ready, timeout=PATIENCE):
        """Wait until the pings, or the counts, satisfy `ready`; return whether they do."""
        end = time.monotonic() + timeout
        with self._news:
            while not ready(self.pings) and time.monotonic() < end:
                # Counts change without news.
                self._news.wait(_POLL)
            return ready(self.pings)

    def wait_for_more(self, count=1, timeout=PATIENCE):
        """Wait for `count` more pings than there are now; return whether they came."""
        wanted = len(self.pings) + count
        return self.wait(lambda pings: len(pings) >= wanted, timeout)

    def _note(self, ping):
        with self._news:
            self.pings.append(ping)
            self._news.notify_all()
