"""Runs the unit tests with the oldest versions that the package claims, in the environment of environment.py.

What the package does is shown with the newest versions. Here it is shown that all which it asks of Python, numpy,
scipy, numba and the others is there and means the same. One case of each test does for that, and none of those that are
long, which take many scans through the same code, or marked newest_only.

Arguments go to pytest: python3 scripts/oldest/run.py test/unit/mlsm_manager
"""

import os
import subprocess
import sys
from typing import Dict, List

from environment import ENVIRONMENT, ROOT
from environment import main as make


def variables() -> Dict[str, str]:
    """Return the variables for processes of the environment: our sources, and where ROS's modules lie.

    PYTHONPATH keeps what it has: ROS's own tools, which tests start, run with the Python that ROS was built for.
    """
    before = os.environ.get("PYTHONPATH", "").split(os.pathsep)
    return {
        **os.environ,
        "PYTHONPATH": os.pathsep.join([str(ROOT / "src"), str(ROOT / "scripts"), *filter(None, before)]),
        "ROS_PYTHON_FOLDERS": os.pathsep.join(_ros_folders()),
    }


def _ros_folders() -> List[str]:
    """Return the module folders of the Python that runs this, which env.bash made the one with ROS."""
    return [folder for folder in sys.path if folder.endswith("-packages") and "/venv/" not in folder]


def main(arguments: List[str]) -> int:
    """Make the environment where it is missing and run pytest in it; return the exit status."""
    status = make()
    if status:
        return status
    pytest = ["-m", "pytest", "-p", "fewer_tests", "--hypothesis-profile=few", "-m", "not long and not newest_only"]
    command = [str(ENVIRONMENT / "bin/python"), *pytest, *arguments]
    return subprocess.run(command, cwd=str(ROOT), env=variables(), check=False).returncode


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
