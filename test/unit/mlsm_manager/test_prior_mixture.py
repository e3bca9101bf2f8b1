"""A prior that is one of several: which one the echoes speak for, and what it adds until that is clear."""

import numpy as np
import pytest

from mlsm_manager.joint_solver.normal_equations import NormalEquations, Residuals, prior_of
from mlsm_manager.joint_solver.prior_mixture import AdaptedPrior, Gaussian, PriorComponent, PriorMixture, PriorTerm

NARROW, WIDE, SHARE = 0.01, 0.3, 0.8
MIXTURE = PriorMixture(
    (1,), np.zeros(1), np.array([WIDE]), np.array([0.1]), np.zeros(1),
    (PriorComponent("still", SHARE, np.array([NARROW])), PriorComponent("flowing", 1.0 - SHARE, np.array([WIDE]))),
    PriorComponent("DVL", 2.0, np.array([2.0 * NARROW])),
)  # fmt: skip
GRID = np.linspace(-3.0, 3.0, 600001)


def known(mean, deviation):
    return Gaussian(np.array([mean]), np.array([[deviation**2]]))


def with_term(before, term):
    """Return mean and variance of what is known with a term."""
    variance = 1.0 / (1.0 / before.covariance[0, 0] + term.information[0, 0])
    return variance * (before.mean[0] / before.covariance[0, 0] + term.vector[0]), variance


def density(deviation):
    return np.exp(-0.5 * (GRID / deviation) ** 2) / deviation


def integrated(mean, deviation):
    """Return mean and variance by numerical integration; the widest prior, which is in what is known, is taken out."""
    echoes = np.exp(-0.5 * ((GRID - mean) / deviation) ** 2) / density(WIDE)
    weights = echoes * (SHARE * density(NARROW) + (1.0 - SHARE) * density(WIDE))
    weights /= weights.sum()
    middle = weights @ GRID
    return middle, weights @ (GRID - middle) ** 2


@pytest.mark.parametrize(("mean", "deviation"), [(0.0, 0.08), (0.03, 0.05), (0.3, 0.05), (-0.3, 0.03), (0.01, 0.02)])
def test_with_the_term_the_unknown_has_mean_and_variance_of_the_mixture(mean, deviation):
    before = known(mean, deviation)
    found = with_term(before, MIXTURE.term(before))
    np.testing.assert_allclose(found, integrated(mean, deviation), rtol=1e-3, atol=1e-6)


@pytest.mark.parametrize("seed", range(8))
def test_of_an_unknown_of_which_all_components_know_the_same_rounding_decides_nothing(seed):
    widest, rng = np.array([0.1, WIDE]), np.random.RandomState(seed)
    components = [PriorComponent(one.name, one.share, np.append(0.1, one.deviations)) for one in MIXTURE.components]
    mixture = PriorMixture((0, 1), np.zeros(2), widest, widest, np.zeros(2), components, MIXTURE.rival)
    spread = rng.normal(size=(2, 2)) * 0.03
    covariance, mean = spread @ spread.T + 1e-4 * np.eye(2), 0.02 * rng.normal(size=2)
    terms = [mixture.term(Gaussian(mean, covariance * (1.0 + 1e-14 * each))) for each in range(10)]
    np.testing.assert_allclose([term.vector for term in terms], np.tile(terms[0].vector, (10, 1)), rtol=1e-6, atol=1e-6)


@pytest.mark.parametrize(("mean", "likeliest"), [(0.0, "still"), (0.02, "still"), (0.3, "flowing"), (-0.2, "flowing")])
def test_the_echoes_tell_the_component(mean, likeliest):
    assert MIXTURE.likeliest(known(mean, 0.03)).name == likeliest


@pytest.mark.parametrize("mean", [0.0, 0.05, -0.1, 0.3])
def test_a_rival_leads_by_the_ratio_of_the_likelihoods_of_all_echoes(mean):
    echoes = np.exp(-0.5 * ((GRID - mean) / 0.04) ** 2) / density(WIDE)
    rival, mixed = 2.0 * density(2.0 * NARROW), SHARE * density(NARROW) + (1.0 - SHARE) * density(WIDE)
    lead = np.log((echoes * rival).sum() / (echoes * mixed).sum())
    assert MIXTURE.rival_lead(known(mean, 0.04)) == pytest.approx(lead, abs=1e-3)


@pytest.mark.parametrize(
    ("mean", "deviation"), [(0.0, 0.12), (0.06, 0.014)], ids=["before echoes tell it", "between two peaks"]
)
def test_where_a_narrow_prior_does_not_count_nothing_is_made_more_certain(mean, deviation):
    assert MIXTURE.term(known(mean, deviation)).information[0, 0] == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize(("information", "vector"), [(0.0, 0.0), (1e4, 3.0)])
def test_a_term_that_was_added_can_be_taken_out_again(information, vector):
    term, before = PriorTerm(np.array([[information]]), np.array([vector])), known(0.05, 0.04)
    mean, variance = with_term(before, term)
    again = MIXTURE.without(term, np.array([7.0, mean]), np.diag([2.0, variance]))
    np.testing.assert_allclose([again.mean[0], again.covariance[0, 0]], [0.05, 0.04**2])


@pytest.mark.parametrize("truth", [0.0, 0.3])
def test_step_by_step_the_prior_becomes_that_of_the_component_that_holds(truth):
    prior, node, covariance = AdaptedPrior(MIXTURE, None, start=0), np.zeros(2), np.eye(2)
    for _ in range(5):
        equations = NormalEquations(2)
        equations.add(prior_of(np.arange(2), node, np.array([1.0, WIDE])))
        equations.add(Residuals(np.array([[1]]), np.ones((1, 1)), node[1:] - truth, np.array([0.04**-2])))
        prior.add(equations, node, lambda columns, found=covariance: found[np.ix_(columns, columns)])
        information, _ = equations.dense()
        covariance = np.linalg.inv(information)
        node = node - covariance @ equations.gradient
    assert node[1] == pytest.approx(truth, abs=0.01)
    assert np.sqrt(covariance[1, 1]) == pytest.approx(0.04 if truth else 0.015, abs=0.006)


def test_a_model_without_a_mixture_adds_nothing():
    prior, equations = AdaptedPrior(None, None, start=0), NormalEquations(2)
    prior.add(equations, np.zeros(2), np.zeros)
    assert not equations.gradient.any()
    assert prior.term.vector.size == 0
