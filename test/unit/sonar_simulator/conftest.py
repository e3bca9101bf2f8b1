"""What tests of the simulator's worlds share."""

import pytest

from sonar_simulator.world.world_file import load_world


@pytest.fixture
def load(tmp_path):
    """Return a function that loads an SDF file of a world with some content, beside a mesh and a broken one."""
    (tmp_path / "t.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n")
    (tmp_path / "broken.stl").write_bytes(b"\x00" * 7)

    def load_text(content, version="1.6"):
        path = tmp_path / "some.sdf"
        namespace = 'xmlns:sonar="https://example.org"'
        path.write_text(f'<sdf version="{version}" {namespace}><world name="here">{content}</world></sdf>')
        return load_world(path)

    return load_text
