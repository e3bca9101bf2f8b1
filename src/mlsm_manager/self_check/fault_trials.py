"""Takes faults of odometry and sonar out of a whole run, one after the other, and names those without which it fits."""

from dataclasses import replace
from operator import attrgetter
from typing import List, NamedTuple, Optional, Sequence, Tuple

import numpy as np

from mlsm_manager.joint_solver.batch_solver import BatchResult, QuickFit, compared_since, fit_of
from mlsm_manager.joint_solver.normal_equations import State
from mlsm_manager.joint_solver.odometry_log import OdometryLog
from mlsm_manager.joint_solver.odometry_trials import (
    OdometryErrors,
    fit_from,
    freed_errors,
    path_kept,
    path_reported,
    reckoned,
    steps_kept,
    with_odometry,
)
from mlsm_manager.joint_solver.run_log import RunLog
from mlsm_manager.joint_solver.solution import Solution
from mlsm_manager.joint_solver.sonar_trials import (
    SonarFault,
    SonarKind,
    changed_ranges,
    fit_without,
    likeliest,
    likelihood_across,
    ranges_changed_at,
)
from mlsm_manager.odometry.faults import OF_DISTANCES, OF_STAMPS, TURNED, FaultKind, MotionFault, likely_faults
from mlsm_manager.scan_matching.scan import Track
from mlsm_manager.self_check.causes import CERTAIN, NAMED_FROM, Cause, Fault, is_same, unsure_length
from mlsm_manager.self_check.delays import LATE_BY
from mlsm_manager.self_check.motion_findings import MotionFindings

# A fit that lets the odometry err finds less on unbroken recordings: rad, standard deviation of the logarithm of the
# scale, and its mean. Beyond, faults are tried.
_HEADING, _SCALE, _LENGTH = np.radians(1.8), 0.1, 0.06
# Nats by which a run must fit better without a fault of the sonar. For one of the odometry it is NAMED_FROM: wrong
# changes of distances, where half of the circle was heard, gained 6.4, wrong steps of the compass in a marina 6.
_NATS_SONAR = 5.0
# The same for these beside a compass alone: parts of an unbroken marina gain 8 by a wrong tilt, a tilted one 27.
_NATS_ALONE = 15.0
_VAGUE_ALONE = (SonarKind.RANGES, SonarKind.TILT, FaultKind.SLIP, FaultKind.STEP)
# The same for a compass that errs by the heading, where it is alone or errs by less than 5 deg. Alone, an unbroken one
# gains 16 in a canal and broken ones 22. Beside a DVL 4 deg gain up to 10 in an unbroken marina, 5 deg 80 in a harbour.
_NATS_CIRCLE, _LARGE_CIRCLE = 20.0, np.radians(5.0)
# The same for ranges that change by less than from one setting of a sonar to the next, beside a compass alone. An
# unbroken marina gains 15 by 1.12, a tour whose ranges change by that 340.
_NATS_SMALL, _SMALL_CHANGE = 50.0, np.log(1.2)
_SIZED = (FaultKind.CARRIED, *TURNED, *OF_STAMPS)  # whose size pairs of scans or the compass tell: no other is tried
_LARGER = (1.5, 2.0)  # times what a fit finds that believes the odometry in part
_ABOUT = (0.8, 0.9, 1.1, 1.2)  # times what pairs of scans show of a head that slips all the time
_BESIDE = (0.5, 0.75, 0.85, 0.925, 1.075, 1.15, *_LARGER)  # times what is suspected of a sonar
_SECONDS = (-8.0, -4.0, 4.0, 8.0)  # from when a change is suspected: it may come in the midst of a scan
_ROUNDS = 2
_PROMISING = 1.0 / 3.0  # of the nats that a fault needs: with less, other sizes do not reach them
_TURNED = np.radians(15.0)  # between turns that are tried of a vehicle whose compass stuck: scans then still meet
_NATS_TURNED = 15.0  # by which one must be likelier than none: in a marina a wrong one of 24 was so by 4 nats
_SHOWN = 10.0  # nats for a compass that stuck: its headings show it, also where it missed no turn
_MORE = 1.05  # times as much: true distances add 3 % in a marina, and a path that is wrongly halved 17 to 33 %
_EARLIER, _LATER = 4, 2  # nodes: a change of ranges looks like one of distances once the run gives way
# With which scans lie as those of a vehicle that strafes.
_SEEM_TO_STRAFE = (SonarKind.RANGES, FaultKind.SLIP, FaultKind.STUCK)
_FAULTS = 3  # at most, one after the other
_FEWEST = 15  # nodes: fewer do not tell a change from noise, unless pairs of scans show when


class _Trial(NamedTuple):
    """gain: of log likelihood, over the run as it was found before, and over what a turn needs that nobody reported."""

    fault: Fault
    run: Solution
    fit: QuickFit
    track: Track
    gain: float

    @property
    def fitted(self) -> Solution:
        """The run as `fit` says."""
        return self.run.with_state(self.fit.state)


_GAIN = attrgetter("gain")


def without_faults(
    run: Solution, fit: BatchResult, track: Track, suspected: Sequence[Fault], ranges_told: bool = False
) -> MotionFindings:  # fmt: skip
    """Return what speaks against sonar and odometry `track` of a run that is fitted as `fit` says, and the run without.

    suspected: what pairs of scans and beams show. ranges_told: whether messages tell changes of the range setting: no
    other ones are looked for.

    Each fault is taken out and the run fitted again; the one with which echoes agree best is named. What a fit finds
    besides that lets the odometry err makes the position uncertain.
    """
    found, are_few = MotionFindings(run, fit, track), len(fit.node_times) < _FEWEST
    if run.parameters.node_search is not None or not found.is_told or (are_few and not suspected):
        return found
    first = places = found.run.places
    rivals: List[np.ndarray] = []
    suspected = _possible(suspected)
    for _ in range(_FAULTS + 1):
        errors = freed_errors(found.run)
        if errors is None:
            return found
        places = errors.places
        faults = suspected if are_few else [*_likely(errors), *suspected, *_of_sonar(found)]
        faults = _untold(faults, ranges_told)
        if len(found.causes) == _FAULTS or not faults:
            break
        best, rival = _best(found, faults)
        if best.gain < _needed(found, best.fault) or not best.fault.is_beyond(errors.times[-1]):
            break
        found, rivals = _without(found, best), [*rivals, *rival]
        suspected = [fault for fault in suspected if not is_same(fault, best.fault)]
    others = [places, first, *rivals] if found.causes else [places] if _errs(errors) and not are_few else []
    return replace(found, apart=[other - found.run.places for other in others])


def _needed(found: MotionFindings, fault: Fault) -> float:
    """Return by how many nats a run must be likelier without a fault for that to be named."""
    if fault.kind is FaultKind.CIRCLE and (found.is_alone or np.linalg.norm(fault.sizes) < _LARGE_CIRCLE):
        return _NATS_CIRCLE
    if found.is_alone and fault.kind is SonarKind.RANGES and abs(fault.sizes[0]) < _SMALL_CHANGE:
        return _NATS_SMALL
    if found.is_alone and fault.kind in _VAGUE_ALONE:
        return _NATS_ALONE
    return _NATS_SONAR if isinstance(fault, SonarFault) else NAMED_FROM


def _errs(errors: OdometryErrors) -> bool:
    scales = np.log1p(np.maximum(errors.scales, -0.9))
    return bool(errors.headings.std() > _HEADING or scales.std() > _SCALE or abs(scales.mean()) > _LENGTH)


def _likely(errors: OdometryErrors) -> List[Fault]:
    """Return faults that explain what a fit corrects which lets the odometry err; ranges may have changed instead."""
    if not _errs(errors):
        return []
    found = likely_faults(errors.times, errors.yaws, errors.headings, errors.scales)
    if not errors.scales.any():
        return [fault for fault in found if fault.kind not in (*OF_DISTANCES, FaultKind.SLIPS_ON)]
    changed = next(one for one in found if one.kind is FaultKind.DISTANCES)
    number = int(np.searchsorted(errors.times, changed.begin))
    begins = errors.times[max(number - _EARLIER, 1) : number + _LATER]
    possible = [fault for fault in found if fault.is_possible]
    return [*possible, *ranges_changed_at(begins.tolist(), -changed.sizes[0])]


def _of_sonar(found: MotionFindings) -> List[SonarFault]:
    """Return faults of the sonar that may make the run likelier, and are more than mounts usually err.

    With a compass alone no distance tells a change of ranges: what is heard before and after it must.
    """
    faults = [fault for fault in likeliest(found.run, found.fit) if fault.is_beyond(found.fit.node_times[-1])]
    return [*faults, *changed_ranges(found.run)] if found.is_alone else faults


def likelier_without(
    run: Solution, track: Track, suspected: Sequence[Fault], ranges_told: bool
) -> List[Tuple[Fault, Solution]]:
    """Return faults without which a run is likelier of a vehicle that goes ahead, each with the run without it.

    suspected: what pairs of scans and headings show; of it only slips of the head, compasses that stuck and changes of
    ranges are tried. ranges_told: whether messages tell changes of ranges: none are tried.
    """
    fit = fit_of(run)
    found = MotionFindings(replace(run, state=fit.state), fit, track)
    faults = [*changed_ranges(run), *(one for one in _possible(suspected) if one.kind in _SEEM_TO_STRAFE)]
    trials = [_tried(found, one) for one in _untold(faults, ranges_told)]
    return [(trial.fault, trial.fitted) for trial in trials if trial.gain > 0.0]


def logged_without(log: RunLog, fault: Fault, run: Solution) -> RunLog:
    """Return what a run had logged without a fault, and with the headings of `run`, which is without it."""
    if isinstance(fault, SonarFault):
        return fault.logged(log)
    track = log.odometry.track_from(-np.inf)
    return log.since(0, OdometryLog.of(track.with_poses(run.path(track.times))))


def _best(found: MotionFindings, faults: Sequence[Fault]) -> Tuple[_Trial, List[np.ndarray]]:
    """Return the trial that makes the run likeliest, and where it went by another turn that is nearly as likely."""
    trials = [_tried(found, fault) for fault in faults]
    worth_it = [trial for trial in trials if trial.gain > 0.0 or not isinstance(trial.fault, SonarFault)]
    best = max(worth_it or trials, key=_GAIN)
    for _ in range(_rounds(found, best)):
        best = max([best, *(_tried(found, fault, best.fit.state) for fault in _beside(best.fault))], key=_GAIN)
    return best, _rival(best, trials) if best.fault.kind is FaultKind.STUCK else []


def _rounds(found: MotionFindings, best: _Trial) -> int:
    """Return how many rounds of other sizes are tried: none for a fault of the sonar that is far from being named.

    Each round takes seconds. The first trials of 37 faults that were named in broken recordings gained half of what
    that needs or more, those of a compass alone in an unbroken marina a fifth or less.
    """
    if not isinstance(best.fault, SonarFault):
        return 1
    return _ROUNDS if best.gain > _PROMISING * _needed(found, best.fault) else 0


def _rival(best: _Trial, trials: Sequence[_Trial]) -> List[np.ndarray]:
    """Return the places (n, 2) [m] of the turn that leads farthest from the best of a stuck compass, if any."""
    least = best.fit.log_likelihood - _NATS_TURNED
    others = [one for one in trials if is_same(one.fault, best.fault) and one.fit.log_likelihood > least]
    places = [one.fitted.places for one in others]
    return [max(places, key=lambda one: float(np.hypot(*(one - best.fitted.places).T).mean()))] if places else []


def _possible(suspected: Sequence[Fault]) -> List[Fault]:
    """Return what suspected faults may be.

    Nobody tells how far a vehicle turned while its compass stuck, and each time takes 24 trials: the longest ones only
    are tried. A slip that is suspected of the head meanwhile is that turn.
    """
    stuck = sorted((one for one in suspected if one.kind is FaultKind.STUCK), key=lambda one: one.begin - one.end)

    def is_missed_turn(fault: Fault) -> bool:
        return fault.kind is FaultKind.SLIP and any(one.begin <= fault.begin <= one.end for one in stuck)

    others = [one for one in suspected if one.kind is not FaultKind.STUCK and not is_missed_turn(one)]
    turns = (_TURNED * np.arange(-12, 12)).tolist()
    return [*others, *(replace(one, sizes=(turn,)) for one in stuck[:_FAULTS] for turn in turns)]


def _untold(faults: Sequence[Fault], ranges_told: bool) -> List[Fault]:
    """Return the faults without changes of ranges, where messages tell all of these."""
    return [fault for fault in faults if fault.kind is not SonarKind.RANGES or not ranges_told]


def _beside(fault: Fault) -> List[Fault]:
    if fault.kind is FaultKind.STUCK:
        return [replace(fault, sizes=(fault.sizes[0] + turn,)) for turn in (-_TURNED / 3.0, _TURNED / 3.0)]
    if fault.kind in _SIZED:
        return []
    if fault.kind is FaultKind.SLIPS_ON:
        return [fault.times(factor) for factor in _ABOUT]
    others = [fault.times(factor) for factor in (_BESIDE if isinstance(fault, SonarFault) else _LARGER)]
    if fault.kind is SonarKind.RANGES:
        others += [replace(fault, begin=fault.begin + seconds) for seconds in _SECONDS]
    return [other for other in others if other.is_possible]


def _tried(found: MotionFindings, fault: Fault, start: Optional[State] = None) -> _Trial:
    """Return the trial of a fault. start: where the fit without a fault of the sonar begins; None for the usual."""
    if isinstance(fault, SonarFault):
        run, fit = fit_without(found.run, fault, start)
        gain = fit.log_likelihood - found.fit.log_likelihood
        if not np.isnan(fault.begin):
            unchanged = replace(fault, sizes=(0.0,))
            gain = likelihood_across(run, fit.state, fault) - likelihood_across(found.run, found.fit.state, unchanged)
        return _Trial(fault, run, fit, found.track, gain)
    track = fault.mended(found.track)
    run = with_odometry(found.run, track)
    if fault.kind is FaultKind.STUCK:  # how the vehicle turned meanwhile the echoes tell
        model = run.parameters.odometry.stuck(fault.begin, fault.end)
        run = replace(run, parameters=replace(run.parameters, odometry=model))
    fit = fit_from(run, _starts(found, run, fault))
    gain = fit.log_likelihood - found.fit.log_likelihood
    if fault.kind is FaultKind.STUCK:
        gain += (_SHOWN if found.is_alone else 0.0) - (_NATS_TURNED if fault.sizes[0] else 0.0)
    if fault.kind in OF_DISTANCES or fault.kind is FaultKind.CARRIED:
        more = _of_more(found, run, fit, fault.begin)
        # Pairs of scans that meet only with the current count if the pairs that met before speak for it, too.
        gain -= more if fault.kind in OF_DISTANCES or gain < more else 0.0
    return _Trial(fault, run, fit, track, gain)


def _starts(found: MotionFindings, run: Solution, fault: MotionFault) -> List[State]:
    """Return where a fit of `run`, which lacks a fault of the odometry, may begin."""
    if found.is_alone and fault.kind in (FaultKind.STUCK, FaultKind.SLIP):
        return [steps_kept(found.run, run.log)]
    kept = path_kept(found.run, run.log)
    if fault.kind is FaultKind.CARRIED:
        return [State(reckoned(found.run, run.log, kept.nodes, (fault.begin, fault.end)), kept.run)]
    return [kept, path_reported(run)] if fault.kind is FaultKind.SLIPS_ON else [kept]


def _of_more(found: MotionFindings, run: Solution, fit: QuickFit, begin: float) -> float:
    """Return by how much a fit is likelier because more is compared from `begin` [s] on than before: on a path that is
    too short, scans that end where the sonar hears no farther lie on each other.
    """
    before, _ = compared_since(replace(found.run, state=found.fit.state), begin)
    compared, likelihood = compared_since(replace(run, state=fit.state), begin)
    return max(compared - _MORE * before, 0.0) * likelihood / max(compared, 1.0)


def _without(found: MotionFindings, trial: _Trial) -> MotionFindings:
    run, fault = trial.fitted, trial.fault
    # With a compass alone it may as well be the ranges before it that are wrong, and with them the size of all.
    is_size = fault.kind is FaultKind.LENGTH or (found.is_alone and fault.kind is SonarKind.RANGES)
    length = unsure_length(fault.sizes[0]) if is_size else 0.0
    certain = CERTAIN if fault.kind is FaultKind.STUCK else 0.0  # that it did its headings tell
    metres = LATE_BY if fault.kind in OF_STAMPS else 0.0
    cause = Cause(fault.text, certain + trial.gain, fault.begin, length=length, metres=metres, fault=fault)
    return MotionFindings(run, trial.fit.with_covariances(), trial.track, [*found.causes, cause])
