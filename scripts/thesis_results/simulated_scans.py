"""7.1: what each echo model hears in each world."""

import math
from typing import Tuple

import numpy as np
from benchmarks.recorded import ROOT

from node_support.geometry import pose_matrix
from sonar_simulator.echoes.echo_model import ECHO_MODELS, make_echo_model
from sonar_simulator.rays.ray_caster import RayCaster
from sonar_simulator.simulation.sonar_head import Sonar, SonarParameters
from sonar_simulator.world.world import World
from sonar_simulator.world.world_file import load_world
from thesis_results.markdown import joined, prose
from thesis_results.pictures import Pictures, new_figure, to_scale
from thesis_results.scan_images import Turn, draw_turn
from thesis_results.world_views import draw_world

VIEWS = {"basin": ((-20.0, -3.0, -2.0), 50.0), "harbour": ((-5.0, -5.0, -2.0), 50.0), "tank": ((0.0, 0.0, -1.0), 10.0)}
"""Where the sonar is in each world [m], and its range [m]."""
BEAMS = 120


def full_turn(world: World, place: Tuple[float, float, float], model_name: str, reach: float) -> Turn:
    """Return a turn of the head, level at `place` x y z [m]."""
    angles = np.arange(BEAMS) * 2.0 * math.pi / BEAMS
    model = make_echo_model(model_name, {"max_range": reach})
    sonar = Sonar(RayCaster(world), SonarParameters().pattern(), model, np.random.default_rng(1))
    return Turn(angles, sonar.pings(np.repeat(pose_matrix(place)[np.newaxis], BEAMS, axis=0), angles), reach)


def make(pictures: Pictures) -> str:
    """Return the section."""
    figure, axes = new_figure(15.0, 11.0, len(VIEWS), 1 + len(ECHO_MODELS))
    for row, (name, (place, reach)) in zip(axes, VIEWS.items()):
        world = load_world(ROOT / f"worlds/{name}.sdf").world
        draw_world(row[0], world, place)
        row[0].plot(0.0, 0.0, "r.")
        to_scale(row[0], f"{name}, from above", reach)
        for cell, model_name in zip(row[1:], ECHO_MODELS):
            image = draw_turn(cell, full_turn(world, place, model_name, reach))
            to_scale(cell, model_name, reach)
            cell.set(ylabel="")
    figure.colorbar(image, ax=axes[:, -1], shrink=0.4, label="echo strength, one scale for all")
    shown = pictures.save(
        "simulated_scans",
        figure,
        f"""What the echo models hear in the worlds: one turn of {BEAMS} beams each, from where the red point is. Left:
        the world from above. Figure 7.1(d) of the thesis shows a scan of `laser_cone`.""",
    )
    return joined(
        prose("""[The simulated sonar](simulation.md) describes the echo models. `laser_cone` and `collision` are
        the thesis's (6.4); `physical` is what the thesis leaves to future work (8.2): materials, angles of
        incidence, mirror echoes, the receiver."""),
        shown,
    )
