"""What a process frees goes back to the system."""

import subprocess
import sys

from programs import ROOT

# Many arrays of all sizes, of which every tenth stays: its neighbours leave holes.
HOLES = """
import resource, sys
sys.path.insert(0, sys.argv[1])
import numpy as np
from node_support.ros.node import give_back, hold_little
def held():
    return int(open("/proc/self/statm").read().split()[1]) * resource.getpagesize() / 1e6
hold_little()
before = held()
kept = [np.ones(1000 + 37 * number % 9000) for number in range(4000)]
kept = kept[::10]
give_back()
print(held() - before, sum(array.nbytes for array in kept) / 1e6)
"""


def test_holes_between_arrays_that_stay_are_given_back():
    told = subprocess.run([sys.executable, "-c", HOLES, str(ROOT / "src")], capture_output=True, text=True, check=True)
    held, used = map(float, told.stdout.split())
    assert held < 2.0 * used
