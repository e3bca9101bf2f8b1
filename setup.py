"""For catkin, and for `pip install .` without ROS."""

import os
import re
from pathlib import Path

from setuptools import find_packages, setup

HERE = Path(__file__).resolve().parent
NAME = "underwater_map_construction"
# What the modules need beside them; node_support/files.py finds it.
SHARED = (
    "package.xml", "migration/*.yaml", "urdf/*", "worlds/*.sdf", "worlds/models/*/*", "yaml/*", "web/*.*",
    "web/templates/*",
)  # fmt: skip


def shared_files():
    """Return (folder, files) for everything that goes to share/; nothing for catkin, whose CMakeLists.txt does that."""
    if "CATKIN_BINARY_DIR" in os.environ:
        return []
    found = {}
    for pattern in SHARED:
        for path in sorted(HERE.glob(pattern)):
            folder = Path("share", NAME, path.parent.relative_to(HERE))
            found.setdefault(str(folder), []).append(str(path.relative_to(HERE)))
    return sorted(found.items())


setup(
    name=NAME,
    version=re.search("<version>(.*)</version>", (HERE / "package.xml").read_text())[1],
    packages=find_packages(str(HERE / "src")),
    package_dir={"": "src"},
    data_files=shared_files(),
)
