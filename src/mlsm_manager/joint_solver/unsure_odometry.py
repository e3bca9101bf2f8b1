"""The model of an odometry of which nobody knows whether it is a DVL's or reckoned from the thrusters' commands."""

from dataclasses import fields
from typing import NamedTuple

import numpy as np

from mlsm_manager.joint_solver.motion_models import (
    CURRENT_X,
    CURRENT_Y,
    SCALE,
    DvlFactors,
    DvlOdometry,
    ThrusterFactors,
    ThrusterOdometry,
)
from mlsm_manager.joint_solver.prior_mixture import PriorComponent, PriorMixture


class OdometryDoubt(NamedTuple):
    """dvl_share: the probability that the odometry is a DVL's.

    scale_deviation, current_deviation [m/s]: if it is not. no_current: m/s, stands for none. current_told: m/s,
    standard deviation from which on the echoes are asked whether there is a current. scale_walk [1/sqrt(s)],
    current_walk [m/s/sqrt(s)]: how fast what the echoes told is forgotten.
    """

    dvl_share: float
    scale_deviation: float
    current_deviation: float
    no_current: float
    current_told: float
    scale_walk: float
    current_walk: float


class UnsureFactors(ThrusterFactors):
    """As ThrusterFactors, of an odometry that may be a DVL's, of which `rival` is the model.

    Scale and current do not walk within the window of the live solver, nor within a run that is refined.
    """

    def __init__(self, dvl: DvlOdometry, doubt: OdometryDoubt) -> None:
        own = {field.name: getattr(dvl, field.name) for field in fields(DvlOdometry)}
        own["scale_deviation"] = doubt.scale_deviation
        super().__init__(
            ThrusterOdometry(**own, scale_walk=0.0, current_deviation=doubt.current_deviation, current_walk=0.0)
        )
        self._rival = DvlFactors(dvl)
        still, flowing = doubt.no_current, doubt.current_deviation
        share = (1.0 - doubt.dvl_share) / 2.0
        components = (
            PriorComponent("THRUSTERS", share, np.array([doubt.scale_deviation, still, still])),
            PriorComponent("THRUSTERS in a current", share, np.array([doubt.scale_deviation, flowing, flowing])),
        )
        self._mixture = PriorMixture(
            columns=(SCALE, CURRENT_X, CURRENT_Y),
            mean=np.array([dvl.scale, 0.0, 0.0]),
            widest=components[-1].deviations,
            told=np.array([np.inf, doubt.current_told, doubt.current_told]),
            walks=np.array([doubt.scale_walk, doubt.current_walk, doubt.current_walk]),
            components=components,
            rival=PriorComponent("DVL", doubt.dvl_share, np.array([dvl.scale_deviation, still, still])),
        )

    @property
    def mixture(self) -> PriorMixture:
        return self._mixture

    @property
    def rival(self) -> DvlFactors:
        return self._rival
