"""Damaged files of every kind that is read, and the programs that read them."""

import sys
from pathlib import Path

_UNIT_TESTS = Path(__file__).resolve().parents[2] / "test/unit"
# The tests know how to write a file of each kind.
sys.path += [str(_UNIT_TESTS / name) for name in ("", "recordings", "imagenex_852_driver", "sonar_driver")]
