"""Files that are written whole or not at all."""

import os
import tempfile
from contextlib import contextmanager
from pathlib import Path
from typing import Iterator


def write_whole(path: Path, data: bytes) -> None:
    """Write `data` to `path`, making its folder; on any failure an older file stays as it was. Raises OSError."""
    with whole_file(path) as temporary:
        temporary.write_bytes(data)


@contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """Give the path of a temporary file, made beside `path`, that takes its place when the block ends well.

    The folder is made where it is missing; on any failure an older file stays as it was. Raises OSError.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, name = tempfile.mkstemp(dir=str(path.parent), prefix=f".{path.name}.")
    os.close(handle)
    temporary = Path(name)
    try:
        yield temporary
        _flush(temporary)
        os.chmod(name, 0o644)
        os.replace(name, str(path))
    except BaseException:
        temporary.unlink()
        raise


def _flush(path: Path) -> None:
    with path.open("rb") as file:
        os.fsync(file.fileno())
