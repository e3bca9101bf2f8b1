"""Two solvers of the same scans where nobody knows which odometry a vehicle has; the echoes tell which one is right."""

from dataclasses import replace
from typing import Dict, List, Mapping, NamedTuple, Optional, Sequence, Tuple

import numpy as np

from mlsm_manager.joint_solver.batch_solver import BatchResult
from mlsm_manager.joint_solver.estimate import LiveEstimate
from mlsm_manager.joint_solver.known_surfaces import KnownSurfaces
from mlsm_manager.joint_solver.live_solver import ODOMETRY, LiveSolver, name_of
from mlsm_manager.joint_solver.normal_equations import POSE_COLUMNS
from mlsm_manager.joint_solver.parameters import SolverParameters
from mlsm_manager.joint_solver.run_log import RunLog
from mlsm_manager.joint_solver.solution import Fix
from mlsm_manager.scan_matching.scan import Scan
from node_support.errors import RefusedInput

_OTHER = "rival."  # before the names in stored maps
# Nats by which the DVL is likelier: from which on it is believed, which nothing corrects if it is none; below which it
# is not believed any more; below which it is followed no more.
_CLEAR, _DOUBTED, _EXCLUDED = 3.0, 1.0, -12.0
_MOST_TIMES = 1000.0  # more is certain


class Doubt(NamedTuple):
    """told: which is likelier, in words. other: the odometry that is not shown. apart: m between both newest places.

    deviation: m, standard deviation that the other one adds to the newest position. own: m, that without it.
    """

    told: str
    other: str
    apart: float
    deviation: float
    own: float


class RivalSolvers:
    """The solvers of a run: one, or, where its odometry has a rival, one for each. All have one log.

    shown: the solver that is believed. other: that of the other odometry; None where there is none, or it is out of the
    question. switched: whether `shown` was the other one before the newest scan. doubt: None without an other one.
    """

    def __init__(self, shown: LiveSolver, other: Optional[LiveSolver]) -> None:
        self.shown, self.other = shown, other
        self.switched = False
        self.doubt: Optional[Doubt] = None
        self._dvl_lead = np.nan

    @classmethod
    def begun(
        cls, parameters: SolverParameters, sonar_in_base: np.ndarray, start: Optional[np.ndarray] = None,
        known: Optional[KnownSurfaces] = None,
    ) -> "RivalSolvers":  # fmt: skip
        """Return those of a new run; arguments as LiveSolver's."""
        solver = LiveSolver(parameters, RunLog(sonar_in_base), start, known)
        return cls(solver, _of_rival(solver))

    def begun_with(self, parameters: SolverParameters) -> "RivalSolvers":
        """Return those with other parameters that begin where these began and have taken no scan."""
        solver = self.shown.begun_with(parameters, RunLog(self.shown.log.sonar_in_base))
        return RivalSolvers(solver, _of_rival(solver))

    @property
    def parameters(self) -> SolverParameters:
        """What `resumed` needs to have both odometries, where there are two."""
        return self.shown.parameters if self.other is None else self._unsure.parameters

    @property
    def solvers(self) -> List[LiveSolver]:
        return [solver for solver in (self.shown, self.other) if solver is not None]

    def stored(self) -> Dict[str, np.ndarray]:
        """Return all but the scans that `resumed` needs; see LiveSolver.stored."""
        other = {} if self.other is None else self.other.stored()
        return {**self.shown.stored(), **{_OTHER + name: array for name, array in other.items()}}

    @classmethod
    def resumed(
        cls, parameters: SolverParameters, sonar_in_base: np.ndarray, scans: Sequence[Scan],
        stored: Mapping[str, np.ndarray],
    ) -> "RivalSolvers":  # fmt: skip
        """Return those that go on after `scans`. Raises as LiveSolver.resumed does, and RefusedInput."""
        log = RunLog(sonar_in_base)
        log.take(scans, parameters.parts_per_turn, parameters.lookahead)
        shown, other = LiveSolver.resumed(_as_stored(parameters, stored), log, stored), None
        of_other = {name[len(_OTHER) :]: array for name, array in stored.items() if name.startswith(_OTHER)}
        if of_other and parameters.odometry.rival is not None:
            other = LiveSolver.resumed(_as_stored(parameters, of_other), log, of_other)
        return cls(shown, other)

    @property
    def told(self) -> str:
        """What the echoes tell of the odometry; empty where it was named."""
        return "" if np.isnan(self._dvl_lead) else self._told_and_other[0]

    @property
    def lead(self) -> float:
        """By how many nats the shown odometry is likelier than the other one; NaN where there never was one."""
        return -self._dvl_lead if self.shown is self._unsure else self._dvl_lead

    def add(self, scan: Scan, fix: Optional[Fix] = None) -> LiveEstimate:
        """Take the next scan; see LiveSolver.add. fix: in the map of `shown`."""
        self.switched, of_other = False, None
        if fix is not None and self.other is not None:
            # Whatever the odometry is, the scan lies as far from the one before it.
            apart = self.other.estimates[-1].T_map_base - self.shown.estimates[-1].T_map_base
            of_other = replace(fix, place=fix.place + apart[:2])
        self.shown.add(scan, fix)
        if self.other is not None:
            try:
                self.other.solve(of_other)
                self._weigh()
            except RefusedInput:
                self.other, self.doubt, self._dvl_lead = None, None, np.nan
        return self.shown.estimates[-1]

    def _weigh(self) -> None:
        """Show the solver that the echoes speak for, and say how uncertain the other one makes it."""
        self._dvl_lead = self._unsure.odometry.mixture.rival_lead(self._unsure.told)
        is_dvl = self.shown is not self._unsure
        if self._dvl_lead < _DOUBTED if is_dvl else self._dvl_lead > _CLEAR:
            self.show_other()
            self.switched = True
        newest, other = self.shown.estimates[-1], self.other.estimates[-1]
        poses = np.array([[one.T_map_base] for one in (newest, other)])
        added = _added(self.lead, *poses, newest.pose_covariance[np.newaxis], other.pose_covariance[np.newaxis])
        self.shown.estimates[-1] = replace(newest, doubt=added[0])
        self._know(*poses[:, :, :2], added, newest.stated_deviation)
        if self._dvl_lead < _EXCLUDED:
            self.other = self.doubt = None

    def believed(self, fits: Sequence[BatchResult]) -> BatchResult:
        """Show the solver whose fit of the whole run the echoes speak for; return that with what the other one adds.

        fits: of `shown`, and of `other` where there is one.
        """
        if self.other is None:
            return fits[0]
        fit, other = fits
        unsure = fit if self.shown is self._unsure else other
        self._dvl_lead = self._unsure.odometry.mixture.rival_lead(unsure.told)
        if self.lead < 0.0:
            self.show_other()
            fit, other = other, fit
        reported = self.shown.log.node_poses(np.arange(len(fit.node_times)))
        places, others = (reported + one.state.nodes[:, :POSE_COLUMNS] for one in (fit, other))
        added = _added(self.lead, places, others, fit.pose_covariances, other.pose_covariances)
        own = float(np.sqrt(np.trace(fit.pose_covariances[-1, :2, :2])))
        self._know(places, others, added, own)
        return replace(fit, pose_covariances=fit.pose_covariances + added)

    def show_other(self) -> None:
        self.shown, self.other = self.other, self.shown

    @property
    def _unsure(self) -> LiveSolver:
        return self.other if self.shown.odometry.mixture is None else self.shown

    @property
    def _told_and_other(self) -> Tuple[str, str]:
        """What the echoes tell of the odometry, and the name of the one that is not shown."""
        unsure, mixture = self._unsure, self._unsure.odometry.mixture
        names = mixture.likeliest(unsure.told).name, mixture.rival.name
        shown, other = names if self.shown is unsure else names[::-1]
        return likelier(shown, self.lead, other), other

    def _know(self, places: np.ndarray, others: np.ndarray, added: np.ndarray, own: float) -> None:
        """Keep the doubt where it is the largest."""
        apart = np.hypot(*(others - places)[:, :2].T)
        deviation = np.sqrt(np.maximum(np.trace(added[:, :2, :2], axis1=1, axis2=2), 0.0))
        told, other = self._told_and_other
        self.doubt = Doubt(told, other, float(apart.max()), float(deviation.max()), own)


def likelier(shown: str, lead: float, other: str) -> str:
    """Return which of two is likelier and how many times, in words; `shown` is so by `lead` nats."""
    first, second = (shown, other) if lead >= 0.0 else (other, shown)
    times = float(f"{np.exp(min(abs(lead), np.log(_MOST_TIMES))):.0e}")
    if times < 2.0:
        return f"{first}, hardly likelier than {second}"
    return f"{first}, {'more than ' if times >= _MOST_TIMES else ''}{times:.0f} times likelier than {second}"


def _of_rival(solver: LiveSolver) -> Optional[LiveSolver]:
    """Return a solver of the odometry that the one of `solver` may be instead; None where that is certain."""
    rival = solver.odometry.rival
    return None if rival is None else solver.begun_with(replace(solver.parameters, odometry=rival), solver.log)


def _as_stored(parameters: SolverParameters, stored: Mapping[str, np.ndarray]) -> SolverParameters:
    """Return the parameters with the rival of their odometry, if that is what was stored. Raises KeyError."""
    rival = parameters.odometry.rival
    if rival is None or not np.array_equal(stored[ODOMETRY], name_of(rival)):
        return parameters
    return replace(parameters, odometry=rival)


def _added(
    lead: float, poses: np.ndarray, others: np.ndarray, covariances: np.ndarray, other_covariances: np.ndarray
) -> np.ndarray:
    """Return what other poses (n, 3), less likely by `lead` nats, add to the covariances (n, 3, 3) of `poses` (n, 3).

    With it the covariances are those of the squared error where either may be true.
    """
    apart = others - poses
    share = 1.0 / (1.0 + np.exp(lead))
    return share * (np.einsum("na,nb->nab", apart, apart) + other_covariances - covariances)
