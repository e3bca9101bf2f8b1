"""Serves an emulated head on a pseudo-terminal, always at the same path."""

import contextlib
import os
import select
import threading
import time
import tty
from collections import deque
from typing import Callable, Deque, Optional

from imagenex_852_driver.emulator.head import EmulatedHead, Transmission

_READ_SIZE = 4096  # Bytes: many commands; a read takes what is there
_PATIENCE = 1.0  # s: a thread that has not changed its state by now has failed


class PtyServer:
    """A serial port without hardware: `link` is a symbolic link to the terminal that the driver opens.

    Use it as a context manager, which serves from a new thread, or call `serve` from your own thread. While the
    port has disappeared there is no link, and whoever has it open sees the line hang up.
    """

    def __init__(self, head: EmulatedHead, link: str) -> None:
        self._head = head
        self._link = link
        self._changed = threading.Condition()
        self._master: Optional[int] = None
        self._slave: Optional[int] = None
        self._outgoing: Deque[Transmission] = deque()
        self._hidden_until = float("-inf")
        self._stop = threading.Event()
        self._wake_reader, self._wake_writer = os.pipe()
        self._thread: Optional[threading.Thread] = None

    def __enter__(self) -> "PtyServer":
        self._appear()
        self._thread = threading.Thread(target=self.serve, daemon=True)
        self._thread.start()
        return self

    def __exit__(self, *exception: object) -> None:
        self.stop()
        if self._thread:
            self._thread.join()
        os.close(self._wake_reader)
        os.close(self._wake_writer)

    def serve(self) -> None:
        """Serve until `stop` is called; raises OSError when the link cannot be made."""
        try:
            while not self._stop.is_set():
                self._turn()
        finally:
            self._vanish()

    def stop(self) -> None:
        """Make `serve` return; safe from any thread and from signal handlers."""
        self._stop.set()
        self._wake()

    def disappear(self, duration: float = float("inf")) -> None:
        """Remove the port for `duration` seconds, or until `reappear`; it is gone when this returns."""
        self._hide_until(time.monotonic() + duration)
        self._await(lambda: self._master is None)

    def reappear(self) -> None:
        """Bring the port back; it is there when this returns."""
        self._head.absent_until = float("-inf")
        self._hide_until(float("-inf"))
        self._await(lambda: self._master is not None)

    def _hide_until(self, moment: float) -> None:
        self._hidden_until = moment
        self._wake()

    def _await(self, condition: Callable[[], bool]) -> None:
        # Only the serving thread opens and closes the port, because it may be waiting on it at this moment.
        with self._changed:
            self._changed.wait_for(condition, timeout=_PATIENCE)

    def _turn(self) -> None:
        master = self._present_master()
        now = time.monotonic()
        if master is not None:
            self._send_due(master, now)
        sources = [self._wake_reader] if master is None else [self._wake_reader, master]
        readable = select.select(sources, [], [], self._until_next_event(now))[0]
        if self._wake_reader in readable:
            os.read(self._wake_reader, _READ_SIZE)
        if master in readable:
            self._receive(master)

    def _present_master(self) -> Optional[int]:
        hidden_until = max(self._hidden_until, self._head.absent_until)
        hidden = time.monotonic() < hidden_until
        if hidden == (self._master is not None):
            with self._changed:
                if hidden:
                    self._vanish()
                else:
                    self._appear()
                self._changed.notify_all()
        return self._master

    def _receive(self, master: int) -> None:
        with contextlib.suppress(BlockingIOError):
            data = os.read(master, _READ_SIZE)
            self._outgoing.extend(self._head.receive(data, time.monotonic()))

    def _send_due(self, master: int, now: float) -> None:
        while self._outgoing and self._outgoing[0].time <= now:
            # A full terminal loses bytes, like a line that nobody reads.
            with contextlib.suppress(BlockingIOError):
                os.write(master, self._outgoing.popleft().data)

    def _until_next_event(self, now: float) -> Optional[float]:
        if self._master is None:
            hidden_until = max(self._hidden_until, self._head.absent_until)
            return max(0.0, hidden_until - now) if hidden_until < float("inf") else None
        return max(0.0, self._outgoing[0].time - now) if self._outgoing else None

    def _appear(self) -> None:
        self._master, self._slave = os.openpty()
        tty.setraw(self._slave)
        os.set_blocking(self._master, False)
        if os.path.exists(self._link) and not os.path.islink(self._link):
            raise FileExistsError(f"{self._link} exists and is not a symbolic link")
        temporary = f"{self._link}.{os.getpid()}"
        with contextlib.suppress(FileNotFoundError):
            os.unlink(temporary)
        os.symlink(os.ttyname(self._slave), temporary)
        os.replace(temporary, self._link)

    def _vanish(self) -> None:
        if self._master is None:
            return
        with contextlib.suppress(FileNotFoundError):
            if os.readlink(self._link) == os.ttyname(self._slave):
                os.unlink(self._link)
        os.close(self._slave)
        os.close(self._master)
        self._master = self._slave = None
        self._outgoing.clear()

    def _wake(self) -> None:
        os.write(self._wake_writer, b"w")
