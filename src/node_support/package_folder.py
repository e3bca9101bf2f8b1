"""Where worlds, scripts and robot descriptions of this package lie, with ROS or without."""

from pathlib import Path

PACKAGE = "underwater_map_construction"
_MARK = f"<name>{PACKAGE}</name>"


def package_folder() -> Path:
    """Return the folder of the package: a checkout, or share/ of what catkin or pip has installed.

    Raises FileNotFoundError where these modules were copied without it.
    """
    for folder in Path(__file__).resolve().parents:
        for candidate in (folder, folder / "share" / PACKAGE):
            if _is_package(candidate):
                return candidate
    raise FileNotFoundError(2, "the package's folder is not beside its modules; install the whole package", PACKAGE)


def _is_package(folder: Path) -> bool:
    description = folder / "package.xml"
    return description.is_file() and _MARK in description.read_text(encoding="utf-8")
