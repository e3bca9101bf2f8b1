"""Draws what the echo models hear in the worlds, and the recorded tank beside the simulated one."""

import math
import sys
from pathlib import Path

import matplotlib as mpl

mpl.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from benchmarks.tank_recording import BEAMS_PER_TURN, Beams, recording, simulated
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection

from node_support.geometry.matrices import pose_matrix
from sonar_simulator.echoes.echo_model import ECHO_MODELS, make_echo_model
from sonar_simulator.rays.ray_caster import RayCaster
from sonar_simulator.simulation.sonar_head import Sonar, SonarParameters
from sonar_simulator.world.world import World
from sonar_simulator.world.world_file import load_world
from sonar_simulator.world.world_mesh import world_triangles

ROOT = Path(__file__).resolve().parents[1]
VIEWS = {"basin": ((-20.0, -3.0, -2.0), 50.0), "harbour": ((-5.0, -5.0, -2.0), 50.0), "tank": ((0.0, 0.0, -1.0), 10.0)}
COLOURS = "inferno"


def draw_models(path: Path) -> None:
    """Draw each world from above, and a full scan in it by each echo model, in the same scale and orientation."""
    figure, axes = plt.subplots(len(VIEWS), 1 + len(ECHO_MODELS), figsize=(16, 12), constrained_layout=True)
    for row, (name, (place, max_range)) in zip(axes, VIEWS.items()):
        world = load_world(ROOT / f"worlds/{name}.sdf").world
        draw_world(row[0], world, place, max_range)
        row[0].set_ylabel(f"{name}, metres from the sonar")
        for axis, model_name in zip(row[1:], ECHO_MODELS):
            draw_scan(axis, full_scan(world, place, model_name, max_range), max_range)
            axis.set_title(model_name)
    figure.savefig(str(path), dpi=65)


def draw_world(axis: Axes, world: World, place: tuple, max_range: float) -> None:
    """Draw the triangles of a world from above, the highest last, around `place` m."""
    triangles = world_triangles(world)
    corners = triangles.points.reshape(-1, 3, 3) - np.array(place)
    order = np.argsort(corners[..., 2].mean(axis=1))
    axis.add_collection(
        PolyCollection(
            corners[order, :, :2], facecolors=triangles.colours[::3][order], linewidths=0, antialiaseds=False
        )
    )
    axis.plot(0.0, 0.0, "r.")
    axis.set(xlim=(-max_range, max_range), ylim=(-max_range, max_range), aspect="equal", title="from above")


def full_scan(world: World, place: tuple, model_name: str, max_range: float) -> Beams:
    """Return a turn of 120 beams."""
    angles = np.arange(120) * 2.0 * math.pi / 120
    model = make_echo_model(model_name, {"max_range": max_range})
    sonar = Sonar(RayCaster(world), SonarParameters().pattern(), model, np.random.default_rng(1))
    return Beams(angles, sonar.pings(np.repeat(pose_matrix(place)[np.newaxis], 120, axis=0), angles))


def draw_scan(axis: Axes, beams: Beams, max_range: float) -> None:
    """Draw a turn as seen from above."""
    pixels = np.linspace(-max_range, max_range, 500)
    x, y = np.meshgrid(pixels, pixels)
    apart = np.angle(np.exp(1j * (np.arctan2(y, x)[..., np.newaxis] - beams.angles)))
    beam = np.abs(apart).argmin(axis=-1)
    index = (np.hypot(x, y) / max_range * beams.strengths.shape[1]).astype(int)
    inside = index < beams.strengths.shape[1]
    image = np.where(inside, beams.strengths[beam, np.where(inside, index, 0)], 0)
    axis.imshow(image, origin="lower", extent=(-max_range, max_range) * 2, cmap=COLOURS, vmin=0, vmax=127)


def draw_tank(path: Path, real: Beams) -> None:
    """Draw a recorded turn and the simulated one: from above, and how often each strength occurs at each range."""
    first = Beams(real.angles[:BEAMS_PER_TURN], real.strengths[:BEAMS_PER_TURN])
    turns = {"recorded": first, **{name: simulated(first.angles, name) for name in ("physical", "laser_cone")}}
    figure, axes = plt.subplots(2, len(turns), figsize=(16, 10), constrained_layout=True)
    for column, (name, beams) in zip(axes.T, turns.items()):
        draw_scan(column[0], beams, 10.0)
        column[0].set(title=f"{name}: strengths, metres from the sonar")
        draw_histogram(column[1], beams)
        column[1].set(xlabel="range, m", ylabel="strength", title="share of samples, 1 (yellow) to 1/1000")
    figure.savefig(str(path), dpi=65)


def draw_histogram(axis: Axes, beams: Beams) -> None:
    """Draw the shares of strengths in bands of range, and the lines that 50, 75 and 95 % lie below."""
    bins = beams.strengths.shape[1]
    ranges = np.broadcast_to((np.arange(bins) + 0.5) * 10.0 / bins, beams.strengths.shape)
    counts, range_edges, strength_edges = np.histogram2d(
        ranges.ravel(), beams.strengths.ravel(), bins=(np.arange(0.0, 10.01, 0.25), np.arange(0, 181, 6))
    )
    shares = counts / counts.sum(axis=1, keepdims=True)
    axis.pcolormesh(range_edges, strength_edges, np.log10(shares.T + 1e-6), cmap=COLOURS, vmin=-3, vmax=0)
    bands = np.array_split(np.arange(bins), 40)
    middles = [ranges[0, band].mean() for band in bands]
    for share in (50, 75, 95):
        axis.plot(middles, [np.percentile(beams.strengths[:, band], share) for band in bands], "c", linewidth=1)


def main(folder: Path) -> None:
    """Draw all pictures into a folder."""
    folder.mkdir(exist_ok=True)
    draw_models(folder / "simulation_models.png")
    real = recording()
    if real is None:
        print("micron_static.bag is not there (set UMC_DATA): simulation_tank.png stays as it is", file=sys.stderr)
    else:
        draw_tank(folder / "simulation_tank.png", real)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
