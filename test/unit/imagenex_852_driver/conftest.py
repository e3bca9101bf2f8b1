import os
from pathlib import Path

import pytest


@pytest.fixture
def hydroball():
    """Path of the real `.852` log, which is not part of the repository."""
    root = Path(__file__).resolve().parents[3]
    path = Path(os.environ.get("UMC_DATA", root.parent / "shared" / "data")) / "hydroball.852"
    if not path.exists():
        pytest.skip(f"{path} is not there; set UMC_DATA to the folder of the recordings")
    return path
