"""How a node's process ends."""

import os
import subprocess
import sys

END = """
import tempfile
from node_support.ros import node
folder = tempfile.TemporaryDirectory(prefix="of_a_node_")
print(folder.name, flush=True)
node._end(3)
"""


def test_a_node_leaves_no_temporary_folder_of_its_libraries(tmp_path):
    command, environment = [sys.executable, "-c", END], {**os.environ, "TMPDIR": str(tmp_path)}
    done = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=False, env=environment)
    assert (done.returncode, done.stdout.startswith(str(tmp_path)), list(tmp_path.iterdir())) == (3, True, [])
