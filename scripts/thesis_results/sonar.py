"""7.1: what the echo models hear in the worlds, and beside it what real heads heard."""

import math
from typing import Dict, List

import numpy as np
import yaml
from benchmarks.harness import ROOT, recorded_beams
from matplotlib.axes import Axes

from imagenex_852_driver.emulated_852 import Emulated852
from imagenex_852_driver.parameters import HeadSettings
from imagenex_852_driver.reply import ReplyParser, head_angle
from node_support.geometry import pose_matrix
from sonar_processing.beams.beam import Beam
from sonar_simulator.echoes.echo_model import ECHO_MODELS, make_echo_model
from sonar_simulator.echoes.ray_caster import RayCaster
from sonar_simulator.simulation.sonar_head import Sonar, SonarParameters, WorldEchoes
from sonar_simulator.world.world import World
from sonar_simulator.world.world_file import load_world
from thesis_results.page import joined, prose, table
from thesis_results.pictures import STRONGEST, Pictures, Turn, draw_turn, draw_world, new_figure, to_scale

TANK, BANK = "micron_static.bag", "micron_scanline.bag"
RECORDINGS = (TANK, BANK)
TURN_BEAMS = 200  # of the recorded heads
HEAD_PLACE = pose_matrix((0.0, 0.0, -0.38), (0.0, 0.0, -0.126))
"""Where the head stands in worlds/tank.sdf: its walls are built around the recording, its depth is fitted."""
_REACH = 10.0  # m, of both recordings
_BANDS = np.arange(0.5, 10.01, 0.5)
"""Range bands [m] whose histograms are compared. Nearer than half a metre stands a part of the vehicle."""


_VIEWS = {"basin": ((-20.0, -3.0, -2.0), 50.0), "harbour": ((-5.0, -5.0, -2.0), 50.0), "tank": ((0.0, 0.0, -1.0), 10.0)}
"""The worlds, where the sonar is in each [m], and its range [m]."""
_BEAMS = 120
_PLACE_852, _REACH_852 = (-20.0, -20.0, -2.0), 50.0
_SETTINGS_852 = {
    "(a) gain too high": {"max_range": 20, "start_gain_db": 36},
    "(b) tuned": {"max_range": 30, "start_gain_db": 20},
    "(c) tuned": {"max_range": 50, "start_gain_db": 20},
}
"""Of the head, beside 850 kHz (4.3.2); 20 dB is the gain at which the emulated head's echoes are as the model's."""


def make_simulated(pictures: Pictures) -> str:
    """Return the section of what the models hear."""
    figure, axes = new_figure(15.0, 11.0, len(_VIEWS), 1 + len(ECHO_MODELS))
    for row, (name, (place, reach)) in zip(axes, _VIEWS.items()):
        world = load_world(ROOT / f"worlds/{name}.sdf")
        draw_world(row[0], world, place)
        row[0].plot(0.0, 0.0, "r.")
        to_scale(row[0], f"{name}, from above", reach)
        for cell, model_name in zip(row[1:], ECHO_MODELS):
            image = draw_turn(cell, _simulated_turn(world, place, model_name, reach))
            to_scale(cell, model_name, reach)
            cell.set(ylabel="")
    figure.colorbar(image, ax=axes[:, -1], shrink=0.4, label="echo strength, one scale for all")
    return joined(
        prose("""[The simulated sonar](simulation.md) describes the echo models. `laser_cone` and `collision` are
        the thesis's (6.4); `physical` is what the thesis leaves to future work (8.2): materials, angles of
        incidence, mirror echoes, the receiver."""),
        pictures.save(
            "simulated_scans",
            figure,
            f"""What the echo models hear in the worlds: one turn of {_BEAMS} beams each, from where the red point is.
            Left: the world from above. Figure 7.1(d) of the thesis shows a scan of `laser_cone`.""",
        ),
    )


def make_852(pictures: Pictures) -> str:
    """Return the section of an Imagenex 852 that is emulated byte by byte."""
    world = load_world(ROOT / "worlds/basin.sdf")
    figure, (axes,) = new_figure(18.0, 4.6, 1, 1 + len(_SETTINGS_852))
    for cell, (title, changes) in zip(axes, _SETTINGS_852.items()):
        settings = HeadSettings(frequency_khz=850, **changes)
        draw_turn(cell, _turn_of_852(world, settings))
        to_scale(cell, f"{title}: {settings.max_range} m, gain {settings.start_gain_db} dB", settings.max_range)
    image = draw_turn(axes[-1], _simulated_turn(world, _PLACE_852, "laser_cone", _REACH_852))
    to_scale(axes[-1], f"(d) the simulator's laser_cone: {_REACH_852:g} m", _REACH_852)
    figure.colorbar(image, ax=axes[-1], shrink=0.6, label="echo strength")
    return joined(
        prose(f"""The thesis shows its Imagenex 852 with a gain that is too high (a) and tuned (b, c). At hand is no
        recording of it before a wall; this head is emulated: {_BEAMS} switch commands of 27 bytes go to it, and
        its replies are read by the parser of `imagenex_852_driver`. It hears the basin with the pulse of 0.15 m of a
        real head, 5 m before the long wall; `laser_cone` (d) has that of the thesis, 1 m."""),
        pictures.save("imagenex_852", figure, "One turn each from one place. Compare with figure 7.1 of the thesis."),
    )


def _simulated_turn(world: World, place: tuple, model_name: str, reach: float) -> Turn:
    """Return what a model with its defaults hears from a place [m] up to a reach [m]."""
    model, angles = make_echo_model(model_name, {"max_range": reach}), np.arange(_BEAMS) * 2.0 * math.pi / _BEAMS
    sonar = Sonar(RayCaster(world), SonarParameters().pattern(), model, np.random.default_rng(1))
    return Turn(angles, sonar.pings(np.repeat(pose_matrix(place)[np.newaxis], _BEAMS, axis=0), angles), reach)


def _turn_of_852(world: World, settings: HeadSettings) -> Turn:
    """Return what an emulated 852 replies during a turn, as a driver reads it."""
    place = pose_matrix(_PLACE_852)
    head = Emulated852(echo_source=WorldEchoes(world, lambda: place, 1))
    parser, command = ReplyParser(), settings.command()
    sent = (head.receive(command.encode(), float(second)) for second in range(_BEAMS))
    replies = [found.reply for pieces in sent for piece in pieces for found in parser.feed(piece.data)]
    strengths = np.array([np.frombuffer(reply.echoes, np.uint8) for reply in replies])
    return Turn(np.array([head_angle(reply.head_position) for reply in replies]), strengths, settings.max_range)


def make_recorded(pictures: Pictures) -> str:
    """Return the section of two recordings beside what the models hear in a copy of the tank."""
    tank = recorded_beams(TANK)
    first, second = _turn(tank[:TURN_BEAMS]), _turn(tank[TURN_BEAMS : 2 * TURN_BEAMS])
    models = {name: _in_tank(first.angles, name) for name in ECHO_MODELS}
    shown = {"tank, recorded": first, "bank, recorded": _turn(recorded_beams(BANK)[:TURN_BEAMS])}
    shown.update({f"tank, {name}": turn for name, turn in models.items()})
    figure, axes = new_figure(13.0, 8.5, 2, 3)
    for cell, (title, turn) in zip(axes.ravel(), shown.items()):
        image = draw_turn(cell, turn)
        to_scale(cell, title, _REACH)
    figure.colorbar(image, ax=axes[:, -1], shrink=0.5, label="echo strength, one scale for all")
    _draw_medians(axes[-1, -1], {"recorded": first, **models})
    compared = {"its second turn": second, **{f"`{name}`": turn for name, turn in models.items()}}
    return joined(
        prose("""A Tritech Micron at rest in a rectangular tank, another one before a bank (both with a range of 10
        m), and what the echo models hear in `worlds/tank.sdf`, a copy of that tank. Compare with figure 7.1 of the
        thesis, which shows its sonar and its simulator."""),
        pictures.save(
            "recorded_scans",
            figure,
            f"""One turn each, drawn to one scale of metres and one of strengths (0 to {STRONGEST}; the Micron's go
            up to 255). Last: the strength that half of all samples at a range stay below (thin) and the one that 95
            % stay below (thick).""",
        ),
        prose("""How different the strengths are: for every half metre of range the largest difference between the
        cumulative histograms (Kolmogorov and Smirnov, 0: alike, 1: nothing in common), and the mean of these. The
        parameters of `physical` were fitted to the recording's second turn."""),
        table(
            ["the recording's first turn compared with", "difference"],
            [[name, f"{_difference(first, turn):.2f}"] for name, turn in compared.items()],
        ),
    )


def _turn(beams: List[Beam]) -> Turn:
    return Turn(np.array([beam.angle for beam in beams]), np.array([beam.intensities for beam in beams]), _REACH)


def _in_tank(angles: np.ndarray, model_name: str) -> Turn:
    """Return what a model hears in worlds/tank.sdf with the parameters of yaml/sonar_simulator_tank.yaml."""
    parameters = yaml.safe_load((ROOT / "yaml/sonar_simulator_tank.yaml").read_text())
    caster = RayCaster(load_world(ROOT / "worlds/tank.sdf"))
    model = make_echo_model(model_name, parameters[model_name])
    sonar = Sonar(caster, SonarParameters(**parameters["sonar"]).pattern(), model, np.random.default_rng(1))
    return Turn(angles, sonar.pings(np.repeat(HEAD_PLACE[np.newaxis], len(angles), axis=0), angles), _REACH)


def _difference(one: Turn, other: Turn) -> float:
    """Return the mean Kolmogorov-Smirnov distance of the strengths in the bands of range, 0 (alike) to 1."""
    edges = np.rint(_BANDS * one.strengths.shape[1] / _REACH).astype(int)
    found = []
    for low, high in zip(edges[:-1], edges[1:]):
        samples = [turn.strengths[:, low:high].ravel() for turn in (one, other)]
        shares, others = (np.cumsum(np.bincount(each, minlength=256)) / each.size for each in samples)
        found.append(np.abs(shares - others).max())
    return float(np.mean(found))


def _draw_medians(axes: Axes, turns: Dict[str, Turn]) -> None:
    for name, turn in turns.items():
        bands = np.array_split(np.arange(turn.strengths.shape[1]), 40)
        middles = [(band.mean() + 0.5) * turn.range_resolution for band in bands]
        half, most = ([np.percentile(turn.strengths[:, band], share) for band in bands] for share in (50, 95))
        (line,) = axes.plot(middles, most, linewidth=2.0, label=name)
        axes.plot(middles, half, linewidth=0.8, color=line.get_color())
    axes.set(title="strengths over range", xlabel="range, m", ylabel="echo strength")
    axes.legend()
