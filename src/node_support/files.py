"""Where files of this package lie, and files and folders that are written whole or not at all."""

import errno
import fcntl
import os
import shutil
import tempfile
from contextlib import contextmanager
from pathlib import Path
from typing import Iterable, Iterator, Sequence, Tuple

PACKAGE = "underwater_map_construction"
_MARK = f"<name>{PACKAGE}</name>"
_PART = ".umc_part"


def ros_path(path: str) -> Path:
    """Return a path in which ~ stands for the home; a relative one lies in ROS_HOME, ~/.ros where that is not set."""
    return (Path(os.environ.get("ROS_HOME") or "~/.ros") / Path(path).expanduser()).expanduser()


def write_whole(path: Path, data: bytes) -> None:
    """Write `data` to `path`, making its folder; on any failure an older file stays as it was. Raises OSError."""
    with whole_file(path) as temporary:
        temporary.write_bytes(data)


def check_output(path: Path, inputs: Iterable[Path], overwrite: bool, ending: str = "") -> None:
    """Raise OSError unless a program that reads `inputs` may write `path`: a new file, an old one with `overwrite`.

    ending: that the file's name must have.
    """
    if not path.name.endswith(ending):
        raise OSError(errno.EINVAL, f"must end with {ending}", str(path))
    if any(path.exists() and one.exists() and path.samefile(one) for one in inputs):
        raise OSError(errno.EINVAL, "is read too; give another name to write", str(path))
    if path.exists() and not overwrite:
        raise FileExistsError(errno.EEXIST, "exists; --overwrite replaces it", str(path))


@contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """Give the path of a temporary file, made beside `path`, that takes its place when the block ends well.

    The folder is made where it is missing; on any failure an older file stays as it was. What killed processes left
    behind in that folder is removed first. Raises OSError, which names `path` where the system names no file.
    """
    make_folder(path.parent)
    remove_abandoned_parts(path.parent)
    handle, temporary = _locked_part(path)
    try:
        yield temporary
        with temporary.open("rb") as file:
            os.fsync(file.fileno())
        os.chmod(str(temporary), 0o644)
        os.replace(str(temporary), str(path))
    except BaseException as error:
        temporary.unlink()
        if isinstance(error, OSError) and error.errno is not None and error.filename is None:
            raise OSError(error.errno, error.strerror, str(path)) from error
        raise
    finally:
        os.close(handle)


@contextmanager
def whole_folder(folder: Path, inputs: Sequence[Path]) -> Iterator[Path]:
    """Give the path of a temporary folder whose files take their places in `folder` when the block ends well.

    On any failure the files that are there stay as they were, and none comes. Raises OSError, which names the file by
    its place; also where it would replace one of `inputs`.
    """
    parts = folder / f".run{_PART}"
    shutil.rmtree(str(parts), ignore_errors=True)
    make_folder(parts)
    try:
        yield parts
        written = {path: folder / path.relative_to(parts) for path in sorted(parts.rglob("*")) if path.is_file()}
        for target in written.values():
            check_output(target, inputs, overwrite=True)
        for path, target in written.items():
            make_folder(target.parent)
            os.replace(str(path), str(target))
    except OSError as error:
        place = str(error.filename).replace(str(parts), str(folder))
        raise OSError(error.errno, error.strerror, place) from error
    finally:
        shutil.rmtree(str(parts), ignore_errors=True)


def make_folder(path: Path) -> None:
    """Make a folder, and those that it is in, where they are missing. Raises OSError."""
    try:
        path.mkdir(parents=True, exist_ok=True)
    except FileExistsError:
        raise NotADirectoryError(errno.ENOTDIR, "is a file, must be a folder", str(path)) from None


def remove_abandoned_parts(folder: Path) -> None:
    """Remove the temporary files of `whole_file` whose writers were killed. What cannot be removed stays."""
    for part in folder.glob(f".*{_PART}"):
        try:
            handle = os.open(str(part), os.O_RDWR | os.O_NOFOLLOW)
        except OSError:
            continue
        try:
            if _took_lock(handle):
                part.unlink()
        except OSError:
            continue
        finally:
            os.close(handle)


def _locked_part(path: Path) -> Tuple[int, Path]:
    """Return a new temporary file, open and locked: the system drops the lock however its writer ends."""
    while True:
        handle, name = tempfile.mkstemp(dir=str(path.parent), prefix=f".{path.name}.", suffix=_PART)
        # Between these lines another process may take the file for an abandoned one and remove it.
        if _took_lock(handle) and os.fstat(handle).st_nlink:
            return handle, Path(name)
        os.close(handle)


def _took_lock(handle: int) -> bool:
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    return True


def package_folder() -> Path:
    """Return the folder of the package: a checkout, or share/ of what catkin or pip has installed.

    Raises FileNotFoundError where these modules were copied without it.
    """
    for folder in Path(__file__).resolve().parents:
        for candidate in (folder, folder / "share" / PACKAGE):
            description = candidate / "package.xml"
            if description.is_file() and _MARK in description.read_text(encoding="utf-8"):
                return candidate
    raise FileNotFoundError(2, "the package's folder is not beside its modules; install the whole package", PACKAGE)
