import os
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="session")
def recording():
    """Return a function that gives the path of a recording, and skips what needs it, saying so, where it is absent."""

    def found(name):
        path = Path(os.environ.get("UMC_DATA", ROOT.parent / "shared" / "data")) / name
        if not path.is_file():
            pytest.skip(f"{path} is not there; set UMC_DATA to the folder of the recordings")
        return path

    return found
