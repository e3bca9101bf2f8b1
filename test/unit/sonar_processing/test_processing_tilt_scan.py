import math

import pytest

from node_support.health import Health
from node_support.parameters import ParameterError
from sonar_processing.beams.head import SweepCounter
from sonar_processing.scans.tilt_scan import SonarControlParameters, State, TiltScan

SWEEP = {"lowest_deg": -10.0, "highest_deg": 10.0, "step_deg": 10.0, "scan_beams": 4}


class Rig:
    """A servo that obeys at once, unless it is stuck, and a head that pings every tenth of a second."""

    def __init__(self, **values):
        self.time, self.angle, self.stuck, self.silent, self.deaf = 100.0, 0.0, False, False, False
        self.commands, self.warnings, self.scanned = [], [], []
        self.health = Health("sonar_control", self.warnings.append, lambda: self.time)
        parameters = SonarControlParameters(**{**SWEEP, **values})
        self.scan = TiltScan(parameters, self.time, self.commands.append, self.health)

    def run(self, seconds):
        for _ in range(round(seconds / 0.1)):
            self.time += 0.1
            if not self.stuck:
                self.angle = self.commands[-1]
            if not self.deaf:
                self.scan.take_joint(self.time, self.angle)
            if not self.silent:
                if self.scan.state is State.SCANNING:
                    self.scanned.append(round(math.degrees(self.angle)))
                self.scan.take_beam(self.time, 0.0)
            self.scan.tick(self.time)

    @property
    def goals(self):
        return [round(math.degrees(command)) for command in self.commands]


@pytest.mark.parametrize(
    ("scan_beams", "angles_deg", "last"),
    [
        (0, range(90, 800, 3), 120),
        (0, [*range(0, 46, 3), *range(42, -46, -3), *range(-42, 0, 3)], 16 + 30 + 1),
        (5, [0.0] * 9, 5),
        (0, [10.0] * 1000, None),
    ],
    ids=[
        "before the head passes its start",
        "when it was at both ends",
        "after so many beams",
        "never: it stands still",
    ],
)
def test_a_scan_ends(scan_beams, angles_deg, last):
    counter = SweepCounter(scan_beams)
    assert next((n for n, angle in enumerate(angles_deg, 1) if counter.add(math.radians(angle))), None) == last


def test_the_servo_goes_through_its_range_and_back():
    rig = Rig()
    rig.run(6.0)
    assert rig.goals[:6] == [-10, 0, 10, 0, -10, 0]
    assert rig.scan.sweeps >= 2
    assert rig.warnings == []


def test_every_step_gets_one_whole_scan_and_no_beam_of_a_moving_servo():
    rig = Rig(settle_time=0.5)
    rig.run(6.0)
    assert rig.scanned[:12] == [-10] * 4 + [0] * 4 + [10] * 4


def test_horizontal_holds_the_sonar_level():
    rig = Rig(mode="HORIZONTAL", horizontal_deg=2.0)
    rig.run(5.0)
    assert rig.goals == [2]
    assert rig.scan.state is State.HOLDING


def test_one_tilt_only_is_scanned_again_and_again():
    rig = Rig(lowest_deg=5.0, highest_deg=5.0)
    rig.run(5.0)
    assert set(rig.goals) == {5}
    assert rig.scan.sweeps > 2


def test_without_joint_states_nothing_moves_on_and_it_is_said():
    rig = Rig(joint_timeout=2.0)
    rig.deaf = True
    rig.run(9.0)
    assert rig.goals == [-10]
    assert "sonar_servo_joint not in /joint_states" in rig.warnings[0]


def test_a_scan_begins_again_when_joint_states_come_back():
    rig = Rig(scan_beams=40, joint_timeout=1.0)
    rig.run(2.0)
    rig.deaf = True
    rig.run(3.0)
    rig.deaf = False
    rig.run(2.0)
    assert rig.scan.state is State.SCANNING
    assert rig.goals == [-10, -10]


def test_a_servo_that_stands_short_of_its_goal_is_scanned_where_it_stands():
    rig = Rig(move_timeout=3.0)
    rig.stuck = True
    rig.run(4.0)
    assert "at 0.0 deg instead of -10.0" in rig.warnings[0]
    assert rig.scanned[:4] == [0] * 4
    assert rig.goals == [-10, 0, 10]


def test_a_servo_pushed_during_a_scan_is_sent_back():
    rig = Rig(scan_beams=1000)
    rig.run(2.0)
    rig.stuck, rig.angle = True, 0.3
    rig.run(0.2)
    assert "moved to 17.2 deg without a command" in rig.warnings[0]
    assert rig.goals == [-10, -10]


def test_a_scan_without_end_is_given_up():
    rig = Rig(scan_beams=0, scan_timeout=5.0)
    rig.run(6.0)
    assert "beams in 5" in rig.warnings[0]
    assert rig.goals == [-10, 0]


def test_without_beams_the_servo_waits_at_its_step():
    rig = Rig(scan_timeout=5.0)
    rig.silent = True
    rig.run(12.0)
    assert "0 beams" in rig.warnings[0]
    assert rig.goals == [-10]


def test_time_that_jumps_back_begins_the_sweep_again():
    rig = Rig()
    rig.run(2.5)
    rig.time -= 50.0
    rig.run(0.1)
    assert rig.goals[-1] == -10
    assert "the sweep begins again" in rig.warnings[0]


def test_a_clock_that_begins_late_has_missed_nothing():
    rig = Rig()
    rig.scan = TiltScan(rig.scan.parameters, 0.0, rig.commands.append, rig.health)
    rig.scan.tick(0.0)
    rig.run(1.0)
    assert rig.warnings == []


def test_a_range_in_the_wrong_order_is_refused():
    with pytest.raises(ParameterError, match="lowest_deg"):
        SonarControlParameters(lowest_deg=10.0, highest_deg=-10.0)
