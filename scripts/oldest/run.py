"""Runs tests with the oldest versions that the package claims, in the environment of environment.py.

What the package does is shown with the newest versions. Here it is shown that all which it asks of Python, numpy,
scipy, numba and the others is there, which test/oldest asks of every line, and means the same, which unit tests of what
is close to other libraries show. One case of each test does for that, and none of those that are long, which take many
scans through the same code.

Arguments go to pytest, in place of these tests: python3 scripts/oldest/run.py test/unit/mlsm_manager
"""

import os
import subprocess
import sys
from typing import Dict, List

from environment import ENVIRONMENT, ROOT
from environment import main as make

CLOSE_TO_LIBRARIES = {
    "autopilot_link": ("protocol",),
    "georeferencing": ("origin",),
    "mlsm_manager": (
        "block_store", "charts", "comparisons", "compiled_distances", "each", "joint_solver", "map_export", "map_file",
        "map_tool", "mlsm_map", "particles", "place_search", "report", "run_files", "shifted_paths", "thesis_matching",
    ),
    "node_support": ("support_files", "support_node", "support_numba_cache", "support_parameters"),
    "ping360_driver": ("ping360_protocol",),
    "recordings": ("autopilot_logs", "ping_viewer_next", "recordings_bags", "recordings_inspection", "sweep_shifts"),
    "sonar_driver": ("driver_port",),
    "sonar_processing": (
        "processing_echo_extraction", "processing_outliers", "processing_shapes", "processing_threshold",
    ),
    "sonar_simulator": ("simulator_bag_tool", "simulator_mesh_file", "simulator_physical", "simulator_rays"),
    "web_page": ("server",),
}  # fmt: skip
"""Names of test files in each folder of test/unit."""


def variables() -> Dict[str, str]:
    """Return the variables for processes of the environment: our sources, and where ROS's modules lie.

    PYTHONPATH keeps what it has: ROS's own tools, which tests start, run with the Python that ROS was built for.
    """
    before = os.environ.get("PYTHONPATH", "").split(os.pathsep)
    # Of the Python that runs this, which env.bash made the one with ROS.
    ros_folders = [folder for folder in sys.path if folder.endswith("-packages") and "/venv/" not in folder]
    return {
        **os.environ,
        "PYTHONPATH": os.pathsep.join([str(ROOT / "src"), str(ROOT / "scripts"), *filter(None, before)]),
        "ROS_PYTHON_FOLDERS": os.pathsep.join(ros_folders),
    }


def main(arguments: List[str]) -> int:
    """Make the environment where it is missing and run pytest in it; return the exit status."""
    status = make()
    if status:
        return status
    pytest = ["-m", "pytest", "-p", "fewer_tests", "--hypothesis-profile=few", "-m", "not long"]
    tests = [f"test/unit/{folder}/test_{name}.py" for folder, names in CLOSE_TO_LIBRARIES.items() for name in names]
    names_paths = any(not word.startswith("-") for word in arguments)
    command = [str(ENVIRONMENT / "bin/python"), *pytest, *([] if names_paths else ["test/oldest", *tests]), *arguments]
    return subprocess.run(command, cwd=str(ROOT), env=variables(), check=False).returncode


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
