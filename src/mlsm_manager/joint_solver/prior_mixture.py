"""Unknowns whose prior is one of several: the echoes tell which, and until they do each counts by its probability."""

from dataclasses import dataclass
from typing import Callable, NamedTuple, Optional, Sequence, Tuple

import numpy as np

from mlsm_manager.joint_solver.normal_equations import NormalEquations


class Gaussian(NamedTuple):
    """mean: (k,). covariance: (k, k)."""

    mean: np.ndarray
    covariance: np.ndarray


@dataclass(frozen=True)
class PriorTerm:
    """A Gaussian factor exp(-x^T information x / 2 + vector^T x) of k unknowns x. information: (k, k). vector: (k,)."""

    information: np.ndarray
    vector: np.ndarray

    def add(self, equations: NormalEquations, columns: np.ndarray, values: np.ndarray) -> None:
        """Add the factor of unknowns in `columns` (k,), which are at `values` (k,)."""
        gradient = self.information @ values - self.vector
        equations.add_terms(columns[np.newaxis], self.information[np.newaxis], gradient[np.newaxis])

    def removed_from(self, known: Gaussian) -> Gaussian:
        """Return what is known without the factor, which `known` contains."""
        information = np.linalg.inv(known.covariance)
        covariance = np.linalg.inv(information - self.information)
        return Gaussian(covariance @ (information @ known.mean - self.vector), covariance)


class PriorComponent(NamedTuple):
    """One of the priors. share: its probability before the run. deviations: (k,) standard deviations about `mean`."""

    name: str
    share: float
    deviations: np.ndarray


@dataclass(frozen=True)
class PriorMixture:
    """The prior of the unknowns in node columns `columns` (k,): one of the components, nobody knows which.

    The solver holds these unknowns by `widest` (k,) standard deviations about `mean` (k,), and by a term that follows
    from what it knows of them: with it they have mean and covariance of the mixture (the generalised pseudo-Bayes
    estimator of first order, Bar-Shalom, Li and Kirubarajan 2001, 11.6.4).

    A component counts only once the echoes tell the unknowns that it knows better than `widest` to `told` (k,): until
    then a narrow prior that is wrong would draw a map that seems to confirm it. One component has the deviations
    `widest`. walks: (k,) per root second, how fast what the echoes told is forgotten. rival: a prior that another
    solver assumes, which is not mixed; the echoes tell here whether it is right.
    """

    columns: Tuple[int, ...]
    mean: np.ndarray
    widest: np.ndarray
    told: np.ndarray
    walks: np.ndarray
    components: Sequence[PriorComponent]
    rival: PriorComponent

    def without(self, term: PriorTerm, node: np.ndarray, covariance: np.ndarray) -> Gaussian:
        """Return what is known of the mixed ones of a node's unknowns (width,) without a term that was added.

        covariance: (width, width) or larger, of the node.
        """
        own = np.array(self.columns)
        return term.removed_from(Gaussian(node[own], covariance[np.ix_(own, own)]))

    def term(self, known: Gaussian) -> PriorTerm:
        """Return what makes of what is known by widest prior and all echoes what is known with the mixture."""
        posteriors, log_weights = zip(*(self._posterior(known, component) for component in self.components))
        logs = np.array(log_weights) - np.logaddexp.reduce(log_weights)
        # Narrow components may be assumed once the echoes tell what they are narrow in.
        told = np.diag(known.covariance) <= self.told**2
        admitted = np.array([(told | (one.deviations >= self.widest)).all() for one in self.components])
        weights = np.exp(logs) * admitted
        weights /= weights.sum()
        means = np.array([posterior.mean for posterior in posteriors])
        mean = weights @ means
        apart = means - mean
        covariance = sum(weight * own.covariance for weight, own in zip(weights, posteriors))
        covariance = covariance + np.einsum("c,ca,cb->ab", weights, apart, apart)
        return _term_between(known, Gaussian(mean, covariance))

    def rival_lead(self, known: Gaussian) -> float:
        """Return by how many nats `rival` is likelier than the components where widest prior and echoes say `known`.

        It is the ratio of densities of Savage and Dickey (Dickey 1971): no run that assumes the rival need be asked,
        in which the map would confirm it.
        """
        logs = [self._posterior(known, component)[1] for component in self.components]
        return self._posterior(known, self.rival)[1] - float(np.logaddexp.reduce(logs))

    def likeliest(self, known: Gaussian) -> PriorComponent:
        """Return the component that is the most probable where the widest prior and all echoes say `known`."""
        return max(self.components, key=lambda component: self._posterior(known, component)[1])

    def _posterior(self, known: Gaussian, component: PriorComponent) -> Tuple[Gaussian, float]:
        """Return what is known if a component is the prior, and the logarithm of its probability times a constant."""
        added = np.diag(component.deviations**-2.0 - self.widest**-2.0)
        before = np.linalg.inv(known.covariance)
        covariance = np.linalg.inv(before + added)
        off = known.mean - self.mean
        mean = covariance @ before @ off
        log_weight = np.log(component.share) + np.log(self.widest / component.deviations).sum()
        log_weight += 0.5 * (np.linalg.slogdet(covariance)[1] - np.linalg.slogdet(known.covariance)[1])
        log_weight -= 0.5 * (off @ before @ off - mean @ (before + added) @ mean)
        return Gaussian(self.mean + mean, covariance), float(log_weight)


class AdaptedPrior:
    """The prior of one node in a problem that is solved step by step; it follows what each step finds.

    term: the one of the newest step; empty for a model without a mixture.
    """

    def __init__(self, mixture: Optional[PriorMixture], term: Optional[PriorTerm], start: int) -> None:
        """term: to begin with; None for what is known without any echo. start: first column of the node."""
        self._mixture, self.term, self._start = mixture, PriorTerm(np.zeros((0, 0)), np.zeros(0)), start
        self._is_added = False
        if mixture is not None:
            self.term = term or mixture.term(Gaussian(mixture.mean, np.diag(mixture.widest**2)))

    def add(self, equations: NormalEquations, node: np.ndarray, covariance: Callable[[np.ndarray], np.ndarray]) -> None:
        """Add what follows from the step before to the unknowns of the node (width,).

        covariance: from columns (k,) to theirs after that step (k, k).
        """
        if self._mixture is None:
            return
        own = np.array(self._mixture.columns)
        columns = self._start + own
        if self._is_added:
            found = Gaussian(node[own], covariance(columns))
            self.term = self._mixture.term(self.term.removed_from(found))
        self._is_added = True
        self.term.add(equations, columns, node[own])


def _term_between(known: Gaussian, wanted: Gaussian) -> PriorTerm:
    """Return the factor that makes `wanted` of `known`; along axes where that knows less, as between two peaks, none.

    Where all components know the same of an unknown, rounding alone says whether anything is known less: either must
    come to the same.
    """
    before, after = np.linalg.inv(known.covariance), np.linalg.inv(wanted.covariance)
    added, axes = np.linalg.eigh(after - before)
    added, axes = added[added > 0.0], axes[:, added > 0.0]
    vector = axes @ (axes.T @ (after @ wanted.mean - before @ known.mean))
    return PriorTerm((axes * added) @ axes.T, vector)
