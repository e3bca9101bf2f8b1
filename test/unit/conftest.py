import sys
from pathlib import Path

from hypothesis import settings

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "scripts"))

settings.register_profile("repeatable", derandomize=True, deadline=None)
# For a second run of all tests with other versions, see scripts/oldest.
settings.register_profile("few", settings.get_profile("repeatable"), max_examples=20)
settings.load_profile("repeatable")
