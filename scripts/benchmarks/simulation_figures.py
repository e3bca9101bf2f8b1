"""The simulated sonar: its speed, its first echoes and how much it sounds like a real one."""

from time import process_time
from typing import List

import numpy as np
from full_scan import ANGLES, RANGES, WORLDS, differences

from benchmarks.table import Row, median_seconds
from benchmarks.tank_recording import BEAMS_PER_TURN, Beams, distances, recording, simulated
from node_support.geometry import pose_matrix
from sonar_simulator.echoes.echo_model import ECHO_MODELS, make_echo_model
from sonar_simulator.rays.ray_caster import RayCaster
from sonar_simulator.simulation.sonar_head import Sonar, SonarParameters
from sonar_simulator.world.world_file import load_world

PLACE = (0.0, 0.0, -2.0)
GRIDS = {45: (9, 5), 500: (50, 10)}
WANTED = {45: ">= 10,000", 500: ">= 2,000"}


def speed_rows() -> List[Row]:
    """Measure whole beams, rays to strengths, in the harbour: in batches of 120, and one by one as when live."""
    world = load_world(WORLDS / "harbour.sdf").world
    caster = RayCaster(world)
    poses = np.repeat(pose_matrix(PLACE)[np.newaxis], len(ANGLES), axis=0)
    rows = []
    for name in ECHO_MODELS:
        for rays, (ray_rows, ray_columns) in GRIDS.items():
            pattern = SonarParameters(ray_rows=ray_rows, ray_columns=ray_columns).pattern()
            sonar = Sonar(caster, pattern, make_echo_model(name, {}), np.random.default_rng(0))
            batch = len(ANGLES) / median_seconds(lambda s=sonar: s.pings(poses, ANGLES), 30, process_time)
            single = 1.0 / median_seconds(lambda s=sonar: s.ping(poses[0], 1.0), 100, process_time)
            figure = f"{batch:,.0f} beams per second of CPU; {single:,.0f} one by one"
            rows.append((f"{name}, {rays} rays, harbour of {len(world.faces)} triangles", figure, WANTED[rays]))
    return rows


def first_echo_rows() -> List[Row]:
    """Compare first echoes of full scans with the nearest surfaces that least distance programming finds."""
    rows = []
    for world in RANGES:
        for model in ECHO_MODELS:
            off = np.abs(differences(world, model))
            figure = (
                f"{100.0 * np.mean(off <= 1):.1f} % of {len(off)} beams, {100.0 * np.mean(off == 0):.1f} % to the bin"
            )
            rows.append((f"first echo within a bin of the nearest surface, {world}, {model}", figure, "100 %"))
    return rows


def recording_rows() -> List[Row]:
    """Compare strengths by range with the recording; the parameters were fitted to its second turn."""
    real = recording()
    if real is None:
        return [("strengths in the tank", "micron_static.bag is not there; set UMC_DATA", "alike")]
    first = Beams(real.angles[:BEAMS_PER_TURN], real.strengths[:BEAMS_PER_TURN])
    second = Beams(*(part[BEAMS_PER_TURN : 2 * BEAMS_PER_TURN] for part in real))
    what = "distance of strengths (KS, mean over bands of 0.5 m), recording's first turn to"
    rows = [(f"{what} its second", f"{distances(first, second).mean():.3f}", "0")]
    for model, wanted in (("physical", "small"), ("collision", ""), ("laser_cone", "")):
        rows.append((f"{what} {model}", f"{distances(first, simulated(first.angles, model)).mean():.3f}", wanted))
    return rows


def rows() -> List[Row]:
    """Return the figures of the simulation."""
    return speed_rows() + first_echo_rows() + recording_rows()
