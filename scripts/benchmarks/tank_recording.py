"""The tank of the real recording micron_static.bag, simulated, and how far the strengths of both are apart."""

from typing import NamedTuple, Optional

import numpy as np
import yaml

from benchmarks.recorded import ROOT, recorded, recorded_beams
from node_support.geometry import pose_matrix
from sonar_simulator.echoes.echo_model import make_echo_model
from sonar_simulator.rays.ray_caster import RayCaster
from sonar_simulator.simulation.sonar_head import Sonar, SonarParameters
from sonar_simulator.world.world_file import load_world

RECORDING = "micron_static.bag"
# The range bands whose histograms are compared. Nearer than half a metre stands a part of the vehicle.
BANDS = np.arange(0.5, 10.01, 0.5)
BEAMS_PER_TURN = 200
# Where the head stands in worlds/tank.sdf: its walls are built around the recording, its depth is fitted.
HEAD_PLACE = pose_matrix((0.0, 0.0, -0.38), (0.0, 0.0, -0.126))


class Beams(NamedTuple):
    """Head angles (beams,) rad and strengths (beams, bins) uint8 of a sonar that stands still; bins end at 10 m."""

    angles: np.ndarray
    strengths: np.ndarray


def recording() -> Optional[Beams]:
    """Return the recorded beams, None where the recording is not."""
    if not recorded(RECORDING).is_file():
        return None
    beams = recorded_beams(RECORDING).beams
    return Beams(np.array([beam.angle for beam in beams]), np.array([beam.intensities for beam in beams]))


def simulated(angles: np.ndarray, model_name: str = "physical", seed: int = 1) -> Beams:
    """Return what a model hears in worlds/tank.sdf with the parameters of yaml/sonar_simulator_tank.yaml."""
    parameters = yaml.safe_load((ROOT / "yaml/sonar_simulator_tank.yaml").read_text())
    caster = RayCaster(load_world(ROOT / "worlds/tank.sdf").world)
    model = make_echo_model(model_name, parameters[model_name])
    sonar = Sonar(caster, SonarParameters(**parameters["sonar"]).pattern(), model, np.random.default_rng(seed))
    return Beams(angles, sonar.pings(np.repeat(HEAD_PLACE[np.newaxis], len(angles), axis=0), angles))


def distances(one: Beams, other: Beams) -> np.ndarray:
    """Return the Kolmogorov-Smirnov distance of the strengths in each band of range, 0 (alike) to 1."""
    edges = np.rint(BANDS * one.strengths.shape[1] / 10.0).astype(int)
    return np.array(
        [
            np.abs(_shares(one.strengths[:, low:high]) - _shares(other.strengths[:, low:high])).max()
            for low, high in zip(edges[:-1], edges[1:])
        ]
    )


def _shares(strengths: np.ndarray) -> np.ndarray:
    """Return the share of samples at or below each strength."""
    return np.cumsum(np.bincount(strengths.ravel(), minlength=256)) / strengths.size
