"""What tests of the simulator's worlds share."""

import pytest

from sonar_simulator.world.world_file import load_world


@pytest.fixture
def load(tmp_path):
    """Return a function that loads an SDF file of a world with some content."""

    def load_text(content, version="1.6"):
        path = tmp_path / "some.sdf"
        namespace = 'xmlns:sonar="https://example.org"'
        path.write_text(f'<sdf version="{version}" {namespace}><world name="here">{content}</world></sdf>')
        return load_world(path)

    return load_text
