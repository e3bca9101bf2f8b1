"""Full scans without noise in the worlds that are shipped, against an independent computation."""

import math
from pathlib import Path

import numpy as np
from least_distance import nearest_range

from node_support.geometry import pose_matrix
from sonar_simulator.echoes.echo_model import make_echo_model
from sonar_simulator.rays.beam_pattern import head_turns
from sonar_simulator.rays.beam_tracer import BeamTracer
from sonar_simulator.rays.ray_caster import RayCaster
from sonar_simulator.simulation.sonar_head import SonarHead, SonarParameters
from sonar_simulator.world.world_file import load_world

WORLDS = Path(__file__).resolve().parents[3] / "worlds"
NOISE_FREE = {
    "laser_cone": {"spread": 0.0, "noise_echoes": 0},
    "collision": {"spread": 0.0, "noise_echoes": 0, "increments": 0},
    "physical": {},
}
RANGES = {"basin": 50.0, "tank": 10.0, "harbour": 50.0}
# Level and tilted, in the open, close to things and under them.
POSES = {
    "basin": [((0, 0, -2), (0, 0, 0)), ((-31, 4.5, -3), (0, 0, 1)), ((20, -3, -1.5), (0.1, 0.3, 0.5))],
    "tank": [((0, 0, -1), (0, 0, 0)), ((1, 0.5, -0.5), (0, 0.4, 0.3))],
    "harbour": [((0, 0, -2), (0, 0, 0)), ((-14, -3, -3), (0.1, -0.2, 1)), ((9, 3, -1), (0, 0.3, 0))],
}
_HEAD = SonarHead(120, 16.0)
ANGLES = np.array([_HEAD.angle(beam) for beam in range(120)])


def differences(name, model_name, rays=(9, 5)):
    """Return by how many bins the first echoes of full scans from all poses lie beyond the nearest surface.

    A beam that is silent counts as one whose first echo is in the bin after the last, on both sides.
    """
    world = load_world(WORLDS / f"{name}.sdf").world
    model = make_echo_model(model_name, {**NOISE_FREE[model_name], "max_range": RANGES[name]})
    pattern = model.pattern(SonarParameters(ray_rows=rays[0], ray_columns=rays[1]).pattern())
    tracer = BeamTracer(RayCaster(world), pattern, model.mirrors)
    found, expected = [], []
    for xyz, rpy in POSES[name]:
        T_world_sonar = pose_matrix(xyz, rpy)
        found.append(_first_bins(tracer, model, T_world_sonar))
        expected.append([_expected_bin(world, T_world_sonar, angle, pattern.planes(), model) for angle in ANGLES])
    return (np.array(found) - np.array(expected)).ravel()


def _first_bins(tracer, model, T_world_sonar):
    rng = np.random.default_rng(0)
    poses = np.repeat(T_world_sonar[np.newaxis], len(ANGLES), axis=0)
    contacts = tracer.contacts(poses, ANGLES, model.max_range, rng)
    # The weakest echoes of the physical model are below what its head can show: they are looked for before that.
    heard = (model.intensities(contacts) if hasattr(model, "intensities") else model.echoes(contacts, rng)) > 0
    return np.where(heard.any(axis=1), heard.argmax(axis=1), model.bins)


def _expected_bin(world, T_world_sonar, angle, planes, model):
    T_world_beam = T_world_sonar.copy()
    T_world_beam[:3, :3] = T_world_sonar[:3, :3] @ head_turns([angle])[0]
    nearest = nearest_range(world, T_world_beam, planes, model.max_range)
    return model.bins if math.isinf(nearest) else math.ceil(nearest * model.bins / model.max_range) - 1
