"""Loads a world from a file: SDF, or a bare mesh."""

from pathlib import Path
from typing import Union

import numpy as np

from sonar_simulator.world.mesh_file import MESH_SUFFIXES, load_mesh
from sonar_simulator.world.sdf import LoadedWorld, load_sdf
from sonar_simulator.world.world import Shape, World


def load_world(path: Union[str, Path]) -> LoadedWorld:
    """Read a world: a mesh if the file's name ends like one, SDF otherwise.

    Raises WorldError if the file cannot be loaded; a part of an SDF file that cannot be loaded becomes a warning.
    """
    path = Path(path)
    if path.suffix.lower() not in MESH_SUFFIXES:
        return load_sdf(path)
    shape = Shape(path.stem, "mesh", np.eye(4), (1.0, 1.0, 1.0), mesh=load_mesh(path))
    return LoadedWorld(World.from_shapes(path.stem, [shape]), ())
