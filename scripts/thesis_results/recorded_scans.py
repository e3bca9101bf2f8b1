"""7.1: real recordings beside what the echo models hear in a copy of the tank."""

import numpy as np
from benchmarks.recorded import recorded_beams
from benchmarks.tank_recording import BEAMS_PER_TURN, RECORDING, Beams, distances, recording, simulated
from matplotlib.axes import Axes

from sonar_simulator.echoes.echo_model import ECHO_MODELS
from thesis_results.markdown import joined, prose, table
from thesis_results.pictures import Pictures, new_figure, to_scale
from thesis_results.scan_images import STRONGEST, Turn, draw_turn

BANK = "micron_scanline.bag"
RECORDINGS = (RECORDING, BANK)
REACH = 10.0  # m, of both recordings


def make(pictures: Pictures) -> str:
    """Return the section."""
    real = recording()
    first, second = (_turn_number(real, number) for number in (0, 1))
    models = {name: simulated(first.angles, name) for name in ECHO_MODELS}
    shown = {"tank, recorded": first, "bank, recorded": _bank()}
    shown.update({f"tank, {name}": beams for name, beams in models.items()})
    figure, axes = new_figure(13.0, 8.5, 2, 3)
    for cell, (title, beams) in zip(axes.ravel(), shown.items()):
        image = draw_turn(cell, Turn(beams.angles, beams.strengths, REACH))
        to_scale(cell, title, REACH)
    figure.colorbar(image, ax=axes[:, -1], shrink=0.5, label="echo strength, one scale for all")
    _draw_medians(axes[-1, -1], {"recorded": first, **models})
    rows = [[f"`{name}`", f"{distances(first, beams).mean():.2f}"] for name, beams in models.items()]
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
            [["its second turn", f"{distances(first, second).mean():.2f}"], *rows],
        ),
    )


def _turn_number(beams: Beams, number: int) -> Beams:
    chosen = slice(number * BEAMS_PER_TURN, (number + 1) * BEAMS_PER_TURN)
    return Beams(beams.angles[chosen], beams.strengths[chosen])


def _bank() -> Beams:
    beams = recorded_beams(BANK).beams[:BEAMS_PER_TURN]
    return Beams(np.array([beam.angle for beam in beams]), np.array([beam.intensities for beam in beams]))


def _draw_medians(axes: Axes, turns: dict) -> None:
    for name, beams in turns.items():
        ranges = (np.arange(beams.strengths.shape[1]) + 0.5) * REACH / beams.strengths.shape[1]
        bands = np.array_split(np.arange(len(ranges)), 40)
        middles = [ranges[band].mean() for band in bands]
        half, most = ([np.percentile(beams.strengths[:, band], share) for band in bands] for share in (50, 95))
        (line,) = axes.plot(middles, most, linewidth=2.0, label=name)
        axes.plot(middles, half, linewidth=0.8, color=line.get_color())
    axes.set(title="strengths over range", xlabel="range, m", ylabel="echo strength")
    axes.legend()
