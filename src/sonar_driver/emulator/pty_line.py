"""A serial port without hardware: a pseudo-terminal, always at the same path."""

import contextlib
import os
import tty
from typing import Optional

_READ_SIZE = 4096  # Bytes: many commands; a read takes what is there


class PtyLine:
    """The head's end of a pseudo-terminal; `link` is a symbolic link to the end that the driver opens."""

    def __init__(self, link: str) -> None:
        self._link = link
        self._master: Optional[int] = None
        self._slave: Optional[int] = None

    def open(self) -> None:
        """Make the terminal and the link to it; raises OSError."""
        if os.path.exists(self._link) and not os.path.islink(self._link):
            raise FileExistsError(f"{self._link} exists and is not a symbolic link")
        self._master, self._slave = os.openpty()
        tty.setraw(self._slave)
        os.set_blocking(self._master, False)
        temporary = f"{self._link}.{os.getpid()}"
        with contextlib.suppress(FileNotFoundError):
            os.unlink(temporary)
        os.symlink(os.ttyname(self._slave), temporary)
        os.replace(temporary, self._link)

    def close(self) -> None:
        """Remove the link, unless somebody else has put theirs there, and hang up."""
        if self._master is None:
            return
        with contextlib.suppress(FileNotFoundError):
            if os.readlink(self._link) == os.ttyname(self._slave):
                os.unlink(self._link)
        os.close(self._slave)
        os.close(self._master)
        self._master = self._slave = None

    def fileno(self) -> int:
        """Return the descriptor that becomes readable when bytes arrive."""
        return self._master

    def read(self) -> bytes:
        """Return the bytes that have arrived, possibly none."""
        with contextlib.suppress(BlockingIOError):
            return os.read(self._master, _READ_SIZE)
        return b""

    def write(self, data: bytes) -> None:
        """Send bytes; a full terminal loses them."""
        with contextlib.suppress(BlockingIOError):
            os.write(self._master, data)
