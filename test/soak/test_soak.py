"""The first minutes of a long mission through the live graph: nothing is lost, flooded, or told wrongly."""

import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]


def test_minutes_leave_nothing_to_complain_of(tmp_path):
    environment = {**os.environ, "PYTHONPATH": f"{ROOT / 'scripts'}:{os.environ['PYTHONPATH']}"}
    command = [sys.executable, "-m", "soaking", "--hours", "0.035", "--output", str(tmp_path)]
    done = subprocess.run(
        command, env=environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=False
    )
    assert done.returncode == 0, done.stdout
    assert "mlsm_core: scans matched" in done.stdout
