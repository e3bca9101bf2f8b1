"""The checks of a run in plain words, each with a light."""

from enum import Enum

import numpy as np

from mlsm_manager.self_check.verdict import Verdict

_NEAR = 0.75  # share of a limit from which on a figure is worth a look


class Light(Enum):
    """How a check ended."""

    GREEN = "fine"
    AMBER = "near its limit"
    RED = "doubtful"
    GREY = "too little to tell"


def light_of(verdict: Verdict) -> Light:
    """Return the light of a check."""
    if np.isnan(verdict.value):
        return Light.GREY
    if verdict.fires:
        return Light.RED
    worse = verdict.limit / verdict.value if verdict.more_is_better else verdict.value / verdict.limit
    return Light.AMBER if worse > _NEAR else Light.GREEN


def light_of_run(lights: "list[Light]") -> Light:
    """Return the light of the whole run: that of its worst check."""
    for light in (Light.RED, Light.AMBER, Light.GREEN):
        if light in lights:
            return light
    return Light.GREY


def sentence(verdict: Verdict) -> str:
    """Return what a check found, in words."""
    if np.isnan(verdict.value):
        return "The run is too short to tell."
    bound = "at least" if verdict.more_is_better else "at most"
    return f"{verdict.value:.2f}, should be {bound} {verdict.limit:g} ({verdict.text})"
