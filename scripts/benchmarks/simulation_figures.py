"""The simulator: how many beams it hears per second, and how much faster than real time simulate_bag is."""

import math
import tempfile
import time
from itertools import product
from pathlib import Path
from time import process_time
from typing import Iterator

import numpy as np
import rosbag

from benchmarks.harness import ROOT, Row, median_seconds
from node_support.geometry import pose_matrix
from sonar_simulator.echoes.echo_model import ECHO_MODELS, make_echo_model
from sonar_simulator.echoes.ray_caster import RayCaster
from sonar_simulator.simulation.simulate_bag import run_simulate_bag
from sonar_simulator.simulation.sonar_head import Sonar, SonarParameters
from sonar_simulator.world.world_file import load_world

_GRIDS = {45: (9, 5), 500: (50, 10)}
_WANTED = {45: ">= 10,000", 500: ">= 2,000"}


def rows() -> Iterator[Row]:
    """Yield beams per second, rays to strengths, in batches of 120 and one by one as when live; then the bags."""
    world = load_world(ROOT / "worlds/harbour.sdf")
    caster, angles = RayCaster(world), np.arange(120) * math.radians(3.0)
    poses = np.repeat(pose_matrix((0.0, 0.0, -2.0))[np.newaxis], len(angles), axis=0)
    for name, rays in product(ECHO_MODELS, _GRIDS):
        pattern = SonarParameters(ray_rows=_GRIDS[rays][0], ray_columns=_GRIDS[rays][1]).pattern()
        sonar = Sonar(caster, pattern, make_echo_model(name, {}), np.random.default_rng(0))
        batch = len(angles) / median_seconds(lambda s=sonar: s.pings(poses, angles), 30, process_time)
        single = 1.0 / median_seconds(lambda s=sonar: s.ping(poses[0], 1.0), 100, process_time)
        figure = f"{batch:,.0f} beams per second of CPU; {single:,.0f} one by one"
        yield f"{name}, {rays} rays, harbour of {len(world.faces)} triangles", figure, _WANTED[rays]
    for tour, model in product(("tank", "harbour", "basin"), ("laser_cone", "physical")):
        yield _bag_row(tour, model)


def _bag_row(world: str, model: str) -> Row:
    """Measure simulate_bag on a world's tour, rays as in the simulator's defaults."""
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "tour.bag"
        wall, busy = time.perf_counter(), process_time()
        run_simulate_bag(["--world", world, "--out", str(out), "--quiet", "--set", f"echo_model={model}"])
        wall, busy = time.perf_counter() - wall, process_time() - busy
        with rosbag.Bag(str(out)) as bag:
            simulated = bag.get_end_time() - bag.get_start_time()
    figure = f"{simulated / wall:.0f} times real time ({simulated / busy:.0f} of its own CPU time)"
    return f"simulate_bag, {world}, {model}, {simulated:.0f} s", figure, ">= 100"
