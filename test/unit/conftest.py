import sys
from pathlib import Path

from hypothesis import HealthCheck, settings

ROOT = Path(__file__).resolve().parents[2]
# Last, so that none of the rostests' modules hides another module.
sys.path.append(str(ROOT / "test" / "rostest"))
# What tests of several packages share, and those of several drivers.
sys.path.append(str(Path(__file__).resolve().parent))
sys.path.append(str(ROOT / "test" / "unit" / "sonar_driver"))

# How fast examples are made says something of the machine, and nothing of the code.
ANY_SPEED = {"deadline": None, "suppress_health_check": [HealthCheck.too_slow]}
# The same examples in every run: more of them would find nothing new in the next one.
settings.register_profile("repeatable", derandomize=True, max_examples=20, **ANY_SPEED)
# Other examples in every run, to look for what nobody thought of: pytest --hypothesis-profile=thorough.
settings.register_profile("thorough", max_examples=1000, **ANY_SPEED)
# For a second run of all tests with other versions, see scripts/oldest.
settings.register_profile("few", settings.get_profile("repeatable"), max_examples=5)
settings.load_profile("repeatable")
