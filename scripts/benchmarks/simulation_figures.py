"""The simulator: how many beams it hears per second, and how much faster than real time simulate_bag is."""

import math
import tempfile
import time
from pathlib import Path
from time import process_time
from typing import List

import numpy as np
import rosbag

from benchmarks.harness import ROOT, Row, median_seconds
from node_support.geometry import pose_matrix
from sonar_simulator.echoes.echo_model import ECHO_MODELS, make_echo_model
from sonar_simulator.echoes.ray_caster import RayCaster
from sonar_simulator.simulation.simulate_bag import main as simulate_bag
from sonar_simulator.simulation.sonar_head import Sonar, SonarParameters
from sonar_simulator.world.world_file import load_world

_GRIDS = {45: (9, 5), 500: (50, 10)}
_WANTED = {45: ">= 10,000", 500: ">= 2,000"}
_BAGS = [("tank", "laser_cone"), ("tank", "physical"), ("harbour", "laser_cone"), ("harbour", "physical"),
         ("basin", "laser_cone"), ("basin", "physical")]  # fmt: skip


def rows() -> List[Row]:
    """Return the figures of the simulator."""
    return [*_beam_rows(), *(_bag_row(world, model) for world, model in _BAGS)]


def _beam_rows() -> List[Row]:
    """Measure whole beams, rays to strengths, in the harbour: in batches of 120, and one by one as when live."""
    world = load_world(ROOT / "worlds/harbour.sdf")
    caster, angles = RayCaster(world), np.arange(120) * math.radians(3.0)
    poses = np.repeat(pose_matrix((0.0, 0.0, -2.0))[np.newaxis], len(angles), axis=0)
    rows = []
    for name in ECHO_MODELS:
        for rays, (ray_rows, ray_columns) in _GRIDS.items():
            pattern = SonarParameters(ray_rows=ray_rows, ray_columns=ray_columns).pattern()
            sonar = Sonar(caster, pattern, make_echo_model(name, {}), np.random.default_rng(0))
            batch = len(angles) / median_seconds(lambda s=sonar: s.pings(poses, angles), 30, process_time)
            single = 1.0 / median_seconds(lambda s=sonar: s.ping(poses[0], 1.0), 100, process_time)
            figure = f"{batch:,.0f} beams per second of CPU; {single:,.0f} one by one"
            rows.append((f"{name}, {rays} rays, harbour of {len(world.faces)} triangles", figure, _WANTED[rays]))
    return rows


def _bag_row(world: str, model: str) -> Row:
    """Measure simulate_bag on a world's tour, rays as in the simulator's defaults."""
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "tour.bag"
        wall, busy = time.perf_counter(), process_time()
        simulate_bag(["--world", world, "--out", str(out), "--quiet", "--set", f"echo_model={model}"])
        wall, busy = time.perf_counter() - wall, process_time() - busy
        with rosbag.Bag(str(out)) as bag:
            simulated = bag.get_end_time() - bag.get_start_time()
    figure = f"{simulated / wall:.0f} times real time ({simulated / busy:.0f} of its own CPU time)"
    return f"simulate_bag, {world}, {model}, {simulated:.0f} s", figure, ">= 100"
