"""Which faults the bench makes: each with its usual size and time, or with others that a seed draws."""

from dataclasses import dataclass, field
from functools import partial
from typing import Callable, Dict, Mapping, Optional, Tuple

import numpy as np

from benchmarks import fault_makers as broken
from benchmarks import rare_faults as rare
from benchmarks.fault_makers import Fault

_SIZES, _TIMES = (0.7, 1.4), (0.3, 0.7)  # between which a seed draws: times the usual size, and shares of the recording
_SHARE = 0.95  # most that a share of the beams may become


@dataclass(frozen=True)
class FaultRow:
    """A kind of fault. text: its name, with {} where the size stands. make: of fault_makers or rare_faults.

    named: a regular expression of causes that are right to name; empty where none is looked for.
    named_alone: of further ones that are right where a compass tells the motion alone, and positions nothing.
    keyword, size: the argument of `make` that a seed draws. is_factor: whether the size is a factor, drawn as its
    logarithm is. begins: whether the fault has a moment to begin at. others: further arguments.
    """

    text: str
    make: Callable
    named: str = ""
    keyword: str = ""
    size: float = 0.0
    is_factor: bool = False
    begins: bool = False
    others: Mapping[str, object] = field(default_factory=dict)
    named_alone: str = ""

    def right_causes(self, alone: bool) -> str:
        """Return a regular expression of causes that are right to name; alone: a compass tells the motion alone."""
        return f"{self.named}|{self.named_alone}" if alone and self.named_alone else self.named

    def drawn(self, seconds: float, rng: Optional[np.random.RandomState]) -> Tuple[str, Fault]:
        """Return name and fault for a recording of so many seconds; drawn at random with `rng`, else as usual."""
        size, arguments, share = self.size, dict(self.others), 0.5
        if rng is not None:
            factor, share = rng.uniform(*_SIZES), rng.uniform(*_TIMES)
            size = float(size**factor) if self.is_factor else factor * size
            size = min(size, _SHARE) if self.keyword == "share" else size
        if self.keyword:
            arguments[self.keyword] = type(self.size)(size)
        if self.begins:
            arguments["at"] = float(round(share * seconds))
        time = f" at {arguments['at']:.0f} s" if self.begins and rng is not None else ""
        return self.text.format(f"{size:.3g}") + time, partial(self.make, **arguments)


_JUMPED, _SLIPPED = "odometry jumped", "head slipped|compass stepped"
_STEPPED = "compass stepped|compass, which stepped"
_FROZEN, _LENGTHS, _DRIFTS = "frozen|held|compass stuck", "distances are", "compass drifts"
_TURNED, _OVER, _IRON, _STAMPS = "sonar is turned", "upside down", "by the heading", "beams were sent|clock"
_MOVES = f"{_TURNED}|direction of motion is turned"
_STOOD, _ARM, _GAIN, _BLIND = "head stood", "the sonar sits", "gain|range setting", "hears nothing"
_SENSELESS = "make no sense"
_REVERSED, _ENDED = "compass counts the other way", "the last fix came|no echo came"
_OFTEN = {"at": 60.0, "every": 60.0}

ROWS = (
    FaultRow("nothing", lambda recording: recording),
    FaultRow("odometry restarts", broken.odometry_restarts, "started again", begins=True),
    FaultRow("odometry jumps {} m", broken.odometry_jumps, _JUMPED, "size", 30.0, begins=True),
    FaultRow("odometry jumps {} m", broken.odometry_jumps, _JUMPED, "size", 5.0, begins=True),
    FaultRow("odometry jumps {} m each minute", broken.odometry_jumps, _JUMPED, "size", 1.0, others=_OFTEN),
    FaultRow("odometry glitches {} m", broken.odometry_glitches, _JUMPED, "size", 50.0, begins=True),
    FaultRow("odometry glitches {} m for 5 poses", broken.odometry_glitches, _JUMPED, "size", 3.0, begins=True,
             others={"samples": 5}),
    FaultRow("odometry frozen {} s, goes on", broken.odometry_freezes, _FROZEN, "seconds", 60.0, begins=True),
    FaultRow("odometry frozen {} s, then right", broken.odometry_freezes, _FROZEN, "seconds", 60.0, begins=True,
             others={"goes_on": False}),
    FaultRow("odometry frozen to the end", broken.odometry_freezes, _FROZEN, begins=True),
    FaultRow("odometry hangs {} s", broken.odometry_hangs, "hung|held|stood|frozen", "seconds", 45.0, begins=True),
    FaultRow("odometry missing {} s", broken.odometry_missing, "", "seconds", 60.0, begins=True),
    FaultRow("odometry {} times as long", broken.odometry_scaled, _LENGTHS, "factor", 0.9, True),
    FaultRow("odometry {} times as long", broken.odometry_scaled, _LENGTHS, "factor", 1.1, True),
    FaultRow("odometry {} times as long from then on", broken.odometry_scaled, _LENGTHS, "factor", 0.5, True, True),
    FaultRow("DVL turned {} deg", broken.dvl_turned, _MOVES, "degrees", 10.0),
    FaultRow("DVL turned {} deg", broken.dvl_turned, _MOVES, "degrees", 30.0),
    FaultRow("compass steps {} deg", broken.compass_steps, _STEPPED, "degrees", 20.0, begins=True),
    FaultRow("compass steps {} deg, positions right", broken.compass_steps, _STEPPED, "degrees", 20.0, begins=True,
             others={"positions_follow": False}),
    FaultRow("compass steps {} deg", broken.compass_steps, _STEPPED, "degrees", -8.0, begins=True),
    FaultRow("compass drifts {} deg/min", broken.compass_drifts, _DRIFTS, "degrees_per_minute", 2.0, begins=True),
    FaultRow("compass sine of {} deg", broken.compass_deviates, _IRON, "degrees", 8.0),
    FaultRow("compass double sine of {} deg", broken.compass_deviates, _IRON, "degrees", 8.0, others={"times": 2}),
    FaultRow("mount turned {} deg", broken.mount_turned, _TURNED, "degrees", 180.0),
    FaultRow("mount turned {} deg", broken.mount_turned, _TURNED, "degrees", 90.0),
    FaultRow("mount turned {} deg", broken.mount_turned, _TURNED, "degrees", -45.0),
    FaultRow("mount turned {} deg", broken.mount_turned, _TURNED, "degrees", 20.0),
    FaultRow("mount turned {} deg", broken.mount_turned, _TURNED, "degrees", 5.0),
    FaultRow("mount upside down", broken.mount_upside_down, _OVER),
    FaultRow("mount {} m ahead", broken.mount_shifted, _ARM, "metres", 2.0),
    FaultRow("head slips {} deg", broken.head_slips, _SLIPPED, "degrees", 20.0, begins=True),
    FaultRow("head slips {} deg each minute", broken.head_slips, f"{_SLIPPED}|{_DRIFTS}", "degrees", 5.0,
             others=_OFTEN),
    FaultRow("head stops {} s", broken.head_stops, _STOOD, "seconds", 120.0, begins=True),
    FaultRow("head stops {} s untold", broken.head_stops, _STOOD, "seconds", 120.0, begins=True,
             others={"tells": False}),
    FaultRow("head reversed", broken.head_reversed, _OVER),
    FaultRow("beams stop {} s", broken.beams_stop, _ENDED, "seconds", 120.0, begins=True),
    FaultRow("{} of the beams missing", broken.beams_missing, "", "share", 0.3),
    FaultRow("range setting x {} untold", broken.range_changed, _GAIN, "factor", 0.5, True, True),
    FaultRow("range setting x {} untold", broken.range_changed, _GAIN, "factor", 1.5, True, True),
    FaultRow("range setting x {} told", broken.range_told, "", "share", 0.5, begins=True),
    FaultRow("range setting x {} told until 300 s", broken.range_told, "", "share", 0.4,
             others={"at": 0.0, "seconds": 300.0}),
    FaultRow("bins twice as long, told", rare.bins_longer, begins=True),
    FaultRow("the front half alone from then on", rare.front_alone, begins=True),
    FaultRow("gain x {}", broken.gain_changed, _GAIN, "factor", 0.3, True, True),
    FaultRow("echoes {} bins longer", broken.echoes_longer, _GAIN, "bins", 10, begins=True),
    FaultRow("half of the circle blind", broken.half_blind, _BLIND),
    FaultRow("deaf {} s", broken.deaf, _ENDED, "seconds", 120.0, begins=True),
    FaultRow("deaf to the end", broken.deaf, _ENDED, begins=True),
    FaultRow("spikes on {} of the beams", broken.spikes, "", "share", 1.0),
    FaultRow("spikes on {} of the beams", broken.spikes, "", "share", 0.31),
    FaultRow("spiral of interference", broken.spiral, "", begins=True),
    FaultRow("stamps {} s late", broken.delayed, _STAMPS, "seconds", 2.0),
    FaultRow("stamps {} s late", broken.delayed, _STAMPS, "seconds", 10.0),
    FaultRow("stamps {} s late from then on", broken.delayed, _STAMPS, "seconds", 3.0, begins=True),
    FaultRow("delay grows to {} s", broken.delayed, _STAMPS, "seconds", 6.0, others={"growing": True}),
    FaultRow("odometry stalls {} s each minute", rare.odometry_stalls, "odometry stalled", "seconds", 5.0),
    FaultRow("positions stand {} s each minute", rare.velocities_missing, "positions stood", "seconds", 5.0),
    FaultRow("odometry trembles by {} m", rare.odometry_noisy, "positions tremble", "metres", 0.2),
    FaultRow("odometry drifts by {} m/s", rare.odometry_drifts, "", "speed", 0.1, others={"at": 0.0}),
    FaultRow("bottom lost for {} s", rare.bottom_lost, "was carried", "seconds", 60.0, begins=True),
    FaultRow("odometry counts z down", rare.odometry_mirrored, _OVER),
    FaultRow("odometry in feet", partial(broken.odometry_scaled, factor=3.28), _LENGTHS),
    FaultRow("odometry {} s late", rare.odometry_late, _STAMPS, "seconds", 3.0),
    FaultRow("x and y of the DVL swapped", rare.positions_swapped, f"{_MOVES}|moves are mirrored"),
    FaultRow("x and y of odom swapped", rare.axes_swapped, "positions are mirrored"),
    FaultRow("compass sticks", rare.compass_sticks, "compass stuck", begins=True),
    FaultRow("compass trembles by {} deg", rare.compass_noisy, "compass trembles", "degrees", 5.0),
    FaultRow("compass {} deg off, positions right", rare.compass_off, _MOVES, "degrees", 60.0),
    FaultRow("compass reversed, positions right", rare.compass_reversed, _REVERSED, others={"positions_follow": False},
             named_alone=_OVER),
    FaultRow("compass reversed", rare.compass_reversed, f"{_REVERSED}|{_OVER}", others={"positions_follow": True}),
    FaultRow("mount tilted {} deg", rare.mount_tilted, "is tilted", "degrees", 20.0),
    FaultRow("head loses {} deg each minute", rare.head_loses_steps, f"{_SLIPPED}|{_DRIFTS}", "degrees", 3.0),
    FaultRow("head's angles tremble by {} deg", rare.head_trembles, "angles tremble", "degrees", 6.0),
    FaultRow("stamps tremble by {} s", rare.stamps_jitter, "", "seconds", 0.5),
    FaultRow("sound {} times as fast", rare.sound_faster, "", "factor", 1.05, True),
    FaultRow("ranges {} m too long", rare.ranges_offset, "", "metres", 1.0),
    FaultRow("echoes come twice, {} as strong", rare.echoes_double, "echoes come twice", "share", 0.7),
    FaultRow("something follows at {} m", rare.hull_heard, "goes along", "metres", 5.0),
    FaultRow("noise of {} in each bin", rare.noise_rises, "", "level", 30.0, begins=True),
    FaultRow("gain fades to {}", rare.gain_fades, "", "factor", 0.3, True),
    FaultRow("all ranges {} times too short", broken.range_changed, _LENGTHS, "factor", 3.28, True, others={"at": 0.0}),
    FaultRow("odometry rounded to {} m", rare.odometry_rounded, "", "metres", 0.1),
    FaultRow("odometry of another vehicle", rare.odometry_senseless, _SENSELESS),
    FaultRow("angles go round twice", rare.head_turns_twice, _SENSELESS),
)  # fmt: skip


def faults(seconds: float, seed: Optional[int] = None) -> Dict[str, Tuple[FaultRow, Fault]]:
    """Return all faults by name, for a recording of so many seconds; seed: of other sizes and times than the usual."""
    rng = None if seed is None else np.random.RandomState(seed)
    drawn = ((row, *row.drawn(seconds, rng)) for row in ROWS)
    return {name: (row, fault) for row, name, fault in drawn}
