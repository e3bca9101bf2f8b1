"""The one folder in which maps lie, each under its name; what is replaced is kept under a numbered name."""

import os
from contextlib import suppress
from itertools import count
from pathlib import Path

from mlsm_manager.surface_map.export.formats import ENDINGS, ExportOptions, export
from mlsm_manager.surface_map.map_file import ENDING, MapFileError, StoredMap, read_map
from node_support.files import ros_path

_LONGEST = 200  # bytes of a name: file systems take 255, numbers and temporary files add some


class MapFolder:
    """Saves and loads maps by name; nothing is written or read outside of the folder."""

    def __init__(self, folder: str) -> None:
        """`folder`: as `ros_path` takes it; it is made when the first map is saved."""
        self.folder = ros_path(folder)

    def path(self, name: str) -> Path:
        """Return where the map `name` lies; an ending that tells no format is part of the name.

        Raises MapFileError for a name that would leave the folder.
        """
        if not name or name.startswith(".") or Path(name).name != name or "\0" in name:
            raise MapFileError(f"name {name!r}: must be a plain file name without a path and not start with a dot")
        if len(name.encode(errors="replace")) > _LONGEST:
            raise MapFileError(f"name {name[:20]!r}...: has {len(name)} letters, must be {_LONGEST} bytes at most")
        path = self.folder / (name if name.endswith(ENDINGS) else f"{name}{ENDING}")
        if path.is_symlink() and path.resolve().parent != self.folder.resolve():
            raise MapFileError(f"{path}: leads to {path.resolve()}, which is not in {self.folder}")
        return path

    def save(self, name: str, stored: StoredMap, overwrite: bool = False) -> Path:
        """Write the map in the format of the name's ending and return its path.

        A file of that name is kept under a numbered one unless `overwrite`. Raises MapFileError for a bad name and for
        an empty map where there is a file already, ExportError for what a format cannot hold, and OSError.
        """
        path = self.path(name)
        if path.exists():
            if not len(stored):
                raise MapFileError(f"{path}: not replaced, the map has no blocks")
            if not overwrite:
                _keep(path)
        export(stored, path, ExportOptions())
        return path

    def put_aside(self, name: str) -> None:
        """Give the map of that name the name NAME.previous; one that had it is gone. Raises OSError.

        Where there is no map of that name, as when another node has put it aside already, nothing is done.
        """
        path = self.path(name)
        with suppress(FileNotFoundError):
            os.replace(str(path), str(path.with_name(f"{path.name[: -len(ENDING)]}.previous{ENDING}")))

    def load(self, name: str) -> StoredMap:
        """Return the map of that name. Raises MapFileError, of one line, where there is none or it is damaged."""
        path = self.path(name)
        try:
            return read_map(path)
        except OSError as error:
            raise MapFileError(f"{path}: {error.strerror or error}") from None


def _keep(path: Path) -> None:
    """Give the file a second name, the first that is free of NAME.1.mlsm, NAME.2.mlsm and so on."""
    for number in count(1):
        with suppress(FileExistsError):
            os.link(str(path), str(path.with_name(f"{path.stem}.{number}{path.suffix}")))
            return
