"""Names what is wrong with mounts, stamps and head: the hypothesis under which scans lie closest to each other."""

from dataclasses import replace
from typing import List, NamedTuple, Optional, Sequence, Tuple

import numpy as np

from mlsm_manager.joint_solver.sonar_trials import SonarFault, SonarKind
from mlsm_manager.odometry.changed_tracks import Mirror, with_headings_reversed, with_positions_turned
from mlsm_manager.odometry.faults import FaultKind, MotionFault
from mlsm_manager.scan_matching.scan import Scan, Track
from mlsm_manager.self_check.carried import carried
from mlsm_manager.self_check.causes import CERTAIN, NAMED_FROM, Assumption, Cause, Fault, ranked
from mlsm_manager.self_check.delays import LATE, late, suspected_delays
from mlsm_manager.self_check.scan_pairs import AS_TOLD, Change, Hypothesis, ScanPairs, around, evidence_of

_COARSE, _FINE = np.radians(15.0), np.radians(3.0)
_LENGTHS = 2.0 ** np.arange(-2.0, 1.1, 0.25)  # true over reported: where these are feet, mirrored moves fit better, too
_TURN_TOLD = np.radians(17.2)  # three deviations of a mounting angle set by eye
_ARM_TOLD = 1.25  # m: nobody measures a mount worse; below, the echoes do not tell it
_SLIP_TOLD = np.radians(12.0)  # three deviations of a compass that turns quickly, or in a gap of the odometry
_SWAPPED = np.radians(30.0)  # from 90 deg: a vehicle that goes ahead does not tell such a turn from x for y
_SLIPS = [Change(float(turn), 1.0) for turn in np.radians(np.arange(-60.0, 61.0, 4.0))]
_RANGES = [Change(0.0, float(factor)) for factor in 2.0 ** (np.arange(-7.0, 8.0) / 5.0) if factor != 1.0]
_FARTHER = 1.15  # times as far as scans lay apart before: less is no reason to look for a slip
_ASIDE = np.radians(np.arange(-12.0, 13.0, 3.0))  # by which a DVL is mounted beside a sonar, by eye
_RATES, _FINE_RATES = np.radians(np.arange(-12.0, 13.0)) / 60.0, np.radians(np.arange(-0.75, 1.0, 0.25)) / 60.0
_CARRIED = 1.3  # times as far as usual: less is no reason to name a current by pairs alone
_FEWEST_SLIPPED, _FEWEST_BEFORE = 3, 6  # pairs of scans between which the head slipped, and before it did
_NATS_MIRRORED = 30.0  # by which it must be likelier: vehicles that go ahead show wrong ones by 7, others right by 60
# nats for each scan by which it must be likelier than nothing if the simplest error is not: a bottom that was lost in a
# marina showed wrong ones by .4, right ones had 1.3 and more.
_EACH_SCAN = 1.0
_TURNED_APART = [Change(float(turn), 1.0) for turn in np.radians([30, 60, 90, 120, 150, -30, -60, -90, -120, -150])]
_COMPARED = 60  # pairs of scans: more tell nothing new
# Of how far scans lie apart that are turned against each other. Where headings, angles or echoes make no sense, a fit
# leaves them .86 to 1.0 times as far apart, in other broken recordings .2 to .8, in unbroken ones .2 to .65.
_NO_BETTER = 0.84
_ASTRAY = 0.4  # of the way: 2.5 such deviations are all of it, and no vehicle went farther
_SENSELESS = Cause(
    "scans lie on each other no better than if they were turned at random: headings, angles of the head or echoes make "
    "no sense", CERTAIN,
)  # fmt: skip
_SIDES = tuple(Hypothesis(is_over=is_over, mirrored=mirrored) for mirrored in Mirror for is_over in (False, True))
_AS_TOLD = "the odometry is as the echoes tell it"
TURN_DEVIATION = np.radians(5.0)  # of a turn that is found so


class EchoFindings(NamedTuple):
    """causes: that are named. mount: the likeliest mount, where one is named; else that of tf.

    suspected: faults that pairs of scans alone do not tell.
    """

    causes: List[Cause]
    mount: Hypothesis
    suspected: Sequence[Fault] = ()


def echo_findings(
    scans: Sequence[Scan], sonar_in_base: np.ndarray, corrections: Optional[Track] = None
) -> EchoFindings:  # fmt: skip
    """Return what the scans of a run tell of mounts, stamps and head.

    sonar_in_base: (2,) m. corrections: T_map_odom over time as a solver found it; None before there is one.
    """
    pairs = ScanPairs(scans, sonar_in_base, corrections)
    if not pairs.tell:
        return EchoFindings([], AS_TOLD)
    honest = pairs.honest
    if not any(scan.track.reports_positions for scan in scans):
        senseless = [_astray(_SENSELESS, pairs)] if _is_chance(pairs, honest) else []
        return EchoFindings(senseless, AS_TOLD, _suspected_changes(pairs) if honest.as_solved else ())
    right = pairs.best([honest, *around(AS_TOLD, "scale", _LENGTHS)])
    best, nats = _turned(pairs, right)
    is_flipped = best.is_over or best.mirrored is not Mirror.NOTHING
    slipping = _slipping(pairs)
    is_turned = is_flipped or abs(best.turn) > _TURN_TOLD
    is_named = is_turned and nats > NAMED_FROM and pairs.evidence(best, slipping) > 0.0
    if _is_chance(pairs, best if is_named else pairs.best([right, slipping])):
        of_delay = [] if is_named or _is_chance(pairs, pairs.best(LATE)) else late(pairs, honest)
        return EchoFindings([_astray(cause, pairs) for cause in of_delay or [_SENSELESS]], AS_TOLD)
    if is_named:
        cause = Cause(turn_text(best), nats, turn=abs(best.turn))
        # No scan lies on another then, so that the path goes anywhere; if it is the odometry, it is mirrored.
        return EchoFindings([_astray(cause, pairs) if is_flipped else cause], best)
    currents = carried(pairs, honest, _CARRIED)
    named = [cause for cause in currents[:1] if cause.evidence > NAMED_FROM]
    # A path that gave way to a current hides it: it is suspected of the odometry itself.
    suspected = [cause.fault for cause in (currents[1:] if named else carried(pairs, AS_TOLD))]
    found = [*late(pairs, honest), *_shifted(pairs, honest), *_changed(pairs), *named]
    aside = pairs.best(around(AS_TOLD, "turn", _ASIDE))
    if slipping.slips and pairs.evidence(slipping, aside) >= NAMED_FROM:
        suspected.append(MotionFault(FaultKind.SLIPS_ON, float(pairs.times[0, 0]), (slipping.slips,)))
    return EchoFindings(ranked(found), AS_TOLD, [*suspected, *suspected_delays(pairs, aside)])


def _is_chance(pairs: ScanPairs, right: Hypothesis) -> bool:
    """Return whether scans lie no better on each other than turned ones do, even if `right` is."""
    numbers, distances = pairs.near(right)
    chosen = np.unique(np.linspace(0, len(numbers) - 1, _COMPARED).astype(int))
    turned = pairs.changed(numbers[chosen], _TURNED_APART, right).mean(axis=1)
    return bool(distances[chosen].mean() > _NO_BETTER * np.median(turned))


def _astray(cause: Cause, pairs: ScanPairs) -> Cause:
    """Return a cause for which a run may lie anywhere along its way."""
    return replace(cause, turn=np.pi, metres=_ASTRAY * pairs.way)


def _turned(pairs: ScanPairs, right: Hypothesis) -> Tuple[Hypothesis, float]:
    """Return the likeliest mount, and its evidence [nats] over `right`, by which none is wrong; of several that are
    about as likely that with fewest errors, if it explains the scans.

    What mirrors an odometry that goes straight ahead does little else than to turn it.
    """
    angles = np.arange(-np.pi, np.pi, _COARSE)
    coarse = [pairs.best(around(side, "turn", angles)) for side in _SIDES]
    fine = [pairs.best(around(one, "turn", one.turn + _FINE * np.arange(-4, 5))) for one in coarse]
    best = pairs.best(fine)
    # The more causes are tried the likelier one fits by chance.
    nats = {one: pairs.evidence(one, right) - np.log(len(_SIDES) * len(angles)) for one in fine}
    alike = [one for one in fine if one == best or pairs.evidence(best, one) < _NATS_MIRRORED]
    found, *others = alike
    if nats[found] <= NAMED_FROM:
        found = next((one for one in others if nats[one] > max(NAMED_FROM, _EACH_SCAN * pairs.scans)), found)
    return found, nats[found]


_REVERSED = {
    Mirror.POSITIONS: "the compass counts the other way, beside positions that are right",
    Mirror.MOVES: "the compass counts the other way, and positions are reckoned with it",
}


def turn_text(found: Hypothesis) -> str:
    if found.mirrored is not Mirror.NOTHING and found.is_over:
        return _REVERSED[found.mirrored]
    if found.mirrored is not Mirror.NOTHING:
        mirrored = f"the odometry's {found.mirrored.value} are mirrored beside its headings"
        return f"{mirrored}: x and y are swapped, or one is reversed"
    turn = (np.degrees(found.turn) + 180.0) % 360.0 - 180.0
    angle = f"turned by {turn:.0f} +- {np.degrees(TURN_DEVIATION):.0f} deg against tf"
    if not found.is_over:
        return f"the sonar is {angle}, or the odometry's direction of motion against the vehicle"
    side = (
        "the sonar is upside down, or its head turns the other way than its driver says, or the odometry counts z down"
    )
    return side if abs(turn) < np.degrees(_TURN_TOLD) else f"{side}; it is {angle} besides"


def put_right(track: Track, found: Hypothesis) -> Tuple[Track, Cause, Assumption]:
    """Return T_odom_base without mirrored positions, turned moves or reversed headings, the cause and what it rests on.

    Where headings were, the sonar or the compass may be turned besides; that is left as it is.
    """
    text, assumed = turn_text(found), Assumption(_AS_TOLD, 0.0)
    if found.is_over:
        right = with_headings_reversed(track, found.mirrored is Mirror.MOVES)
    else:
        right = with_positions_turned(found.mirrored.of(track), -found.turn)
    if not found.is_over and found.mirrored is Mirror.NOTHING:
        angle = f"{np.degrees(found.turn):.0f} +- {np.degrees(TURN_DEVIATION):.0f} deg"
        text = f"the odometry's direction of motion is turned by {angle} against the vehicle"
        if abs(abs(found.turn) - np.pi / 2.0) < _SWAPPED:
            text += ", or its x and y are swapped"
        text += ", or the compass is off"
        assumed = Assumption(f"{_AS_TOLD}, and the compass is right", abs(found.turn))
    return right, Cause(text, CERTAIN, is_mended=True, turn=TURN_DEVIATION), assumed


def _shifted(pairs: ScanPairs, honest: Hypothesis) -> List[Cause]:
    steps = np.arange(-4.0, 4.1)
    ahead = pairs.best(around(AS_TOLD, "ahead", steps))
    found = pairs.best(around(ahead, "aside", steps))
    size, nats = float(np.hypot(found.ahead, found.aside)), pairs.evidence(found, honest) - np.log(2 * len(steps))
    if size < _ARM_TOLD or nats < NAMED_FROM:
        return []
    fault = SonarFault(SonarKind.ARM, np.nan, (found.ahead, found.aside))
    return [Cause(fault.text, nats, metres=size, fault=fault)]


def _changed(pairs: ScanPairs) -> List[Cause]:
    """Return whether scans lie turned, or larger or smaller, on those before a moment, and not on those after it."""
    likely = [one for one in _likely_changes(pairs, [*_SLIPS, *_RANGES], AS_TOLD) if one.evidence > NAMED_FROM]
    return ranked(one for one in likely if one.kind is SonarKind.RANGES or one.turn > _SLIP_TOLD)[:1]


def _suspected_changes(pairs: ScanPairs) -> List[Fault]:
    """Return the likeliest slip of the head, the likeliest longer range setting and the likeliest shorter one.

    Scans are compared along the solver's path, which such a change may have bent.
    """
    slips = [one for one in _likely_changes(pairs, _SLIPS, pairs.honest) if one.turn]
    ranges = _likely_changes(pairs, _RANGES, pairs.honest)
    farther, nearer = ([one for one in ranges if (one.fault.sizes[0] > 0.0) is more] for more in (True, False))
    return [cause.fault for kind in (slips, farther, nearer) for cause in ranked(kind)[:1]]


def _slipping(pairs: ScanPairs) -> Hypothesis:
    """Return the likeliest of a head that slips all the time, beside a DVL that is turned a little.

    Scans are compared along the odometry's path: that of a run that took the angles for right may be bent by them.
    """
    found = pairs.best(around(AS_TOLD, "slips", _RATES))
    found = pairs.best(around(found, "turn", _ASIDE))
    return pairs.best(around(found, "slips", found.slips + _FINE_RATES))


def _likely_changes(pairs: ScanPairs, changes: Sequence[Change], base: Hypothesis) -> List[Cause]:
    """Return the likeliest of `changes` from each scan on from which scans lie farther from those before."""
    numbers, distances = pairs.near(pairs.honest)
    usual, found = pairs.typical_range(), []
    for number, begin in enumerate(pairs.begins.tolist()):
        across, before = (numbers[:, 0] < number) & (numbers[:, 1] >= number), numbers[:, 1] < number
        if across.sum() < _FEWEST_SLIPPED or before.sum() < _FEWEST_BEFORE:
            continue
        apart, alike = distances[across], distances[before]
        if apart.mean() < _FARTHER * alike.mean():
            continue
        table = pairs.changed(numbers[across], changes, base)
        row = int(table.mean(axis=1).argmin())
        nats = evidence_of(apart, table[row], len(np.unique(numbers[across, 1])), alike)
        nats -= np.log(len(pairs.begins) * len(changes))
        turn, ranges = changes[row]
        fault = MotionFault(FaultKind.SLIP, begin, (turn,))
        if ranges != 1.0:
            fault = SonarFault(SonarKind.RANGES, begin, (float(np.log(ranges)),))
        metres = abs(1.0 - ranges) * usual
        found.append(Cause(fault.text, nats, begin, turn=abs(turn), metres=metres, fault=fault))
    return found
