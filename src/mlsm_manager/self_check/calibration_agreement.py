"""Do parts of a run find the same calibration, and one that was to be expected?"""

from typing import Sequence

import numpy as np

from mlsm_manager.self_check.verdict import Verdict


def halves_agree(
    names: Sequence[str],
    first: np.ndarray,
    first_deviations: np.ndarray,
    second: np.ndarray,
    second_deviations: np.ndarray,
    limit: float = 3.0,
) -> Verdict:
    """Return by how many deviations the halves' calibrations (n,) differ at most; `names` (n,) are what they are."""
    spread = np.sqrt(np.asarray(first_deviations) ** 2 + np.asarray(second_deviations) ** 2)
    distances = np.abs(np.asarray(first) - np.asarray(second)) / spread
    worst = int(np.argmax(distances))
    text = f"halves differ most in {names[worst]}: {first[worst]:.4g} and {second[worst]:.4g}, deviations"
    question = "Do the first and the second half of the run find the same errors of sonar and odometry?"
    return Verdict("calibration of the halves", float(distances[worst]), limit, text, question=question)


def as_expected(
    names: Sequence[str],
    expected: np.ndarray,
    expected_deviations: np.ndarray,
    found: np.ndarray,
    limit: float = 3.0,
) -> Verdict:
    """Return by how many deviations what a run `found` (n,) is from what was `expected` (n,) before it, at most.

    `names` (n,) are what they are; n > 0.
    """
    expected, deviations, found = np.asarray(expected), np.asarray(expected_deviations), np.asarray(found)
    distances = np.abs(found - expected) / deviations
    worst = int(np.argmax(distances))
    before = f"{expected[worst]:.4g} +- {deviations[worst]:.4g} was expected"
    text = f"{names[worst]} is {found[worst]:.4g}, {before}, deviations"
    question = "Are the errors of sonar and odometry as large as those of such devices, mounted as described?"
    return Verdict("calibration as expected", float(distances[worst]), limit, text, question=question)
