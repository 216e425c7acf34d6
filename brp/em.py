"""Identification with variables that were never observed, by expectation and maximisation (EM).

P(H | Prox) may be "specified or learned" (lesson 7), and H, which behavior the teacher had in mind, is in no data
set. Each round asks the description so far how probable each value of the hidden variables is for each datum, and
identifies the next description with every datum shared out among these values.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import reduce
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from brp.description import Description, Specification
from brp.errors import DataError, ImpossibleEvidence, TooLarge
from brp.expression import node
from brp.factors import Cases, Density, Factor, Flat
from brp.logs import logarithms
from brp.samples import Data, Samples
from brp.variables import Term, Variable, cells, text

__all__ = ["Identified", "identify_hidden"]

Array = NDArray[np.float64]

LARGEST = 50_000_000
"""How many numbers the shares of all data may be."""
CRUMB = 1e-12
"""A smaller share of a datum is not worth a sample."""


@dataclass(frozen=True)
class Identified:
    """What EM came to: the description, and the log-likelihood (natural) of the data after each round.

    ``converged`` says whether the last round changed it by less than the tolerance; if not, the rounds ran out.
    """

    description: Description
    log_likelihoods: tuple[float, ...]
    converged: bool


def identify_hidden(
    specification: Specification,
    samples: Data,
    *,
    name: str = "",
    weights: ArrayLike | None = None,
    start: Description | None = None,
    rng: np.random.Generator | None = None,
    tolerance: float = 1e-7,
    rounds: int = 1000,
) -> Identified:
    """The description that ``samples`` make of a specification some of whose variables they do not have.

    The first round needs an opinion: a description to ``start`` from, or ``rng``, which shares out every datum at
    random. Without either it is the specification with no data, which must then answer (Laplace laws do), and which
    must not take all hidden values for the same. Only a local optimum is promised: start several times and keep the
    highest likelihood. It ends when a round changes the log-likelihood by less than ``tolerance`` per datum.

    With `Histogram` the likelihood rises in every round. With `Laplace` its product with the law's prior does. The
    moments of a `Gaussian` are not quite its optimum where its values end or its deviation is near their step.

    Raises `DataError` when nothing is hidden or nothing is free, `TooLarge`, and `ImpossibleEvidence` when a datum
    is impossible in the description so far.
    """
    read = Samples.of(samples, specification.variables, weights)
    observed = [v for v in specification.variables if v in read.places]
    if not specification.free or not read.count:
        raise DataError(f"{specification} has no free terms, or there are no samples: nothing can be identified")
    if (read.weights < 0).any():
        raise DataError("a sample to identify from weighs less than nothing")
    terms = _needed(specification, frozenset(observed))
    hidden = [v for v in specification.variables if v not in observed and any(v in t.variables for t in terms)]
    if not hidden:
        raise DataError(f"every variable that {specification} needs was observed: call identify(samples)")
    # Data that are alike are one datum with their weights together.
    columns = np.stack([read[v] for v in observed], axis=1) if observed else np.zeros((read.count, 0), np.intp)
    rows, which = np.unique(columns, axis=0, return_inverse=True)
    weight = np.bincount(which.reshape(-1), read.weights).astype(np.float64)
    if len(rows) * cells(hidden) > LARGEST:
        raise TooLarge(
            f"{len(rows)} different data for {cells(hidden)} values of {text(hidden)} are more than {LARGEST} shares"
        )
    places = _places(observed, hidden, rows)

    def identified(shares: Array) -> Description:
        return _identified(specification, name, places, shares * weight.reshape(-1, *(1 for _ in hidden)))

    if start is not None:
        description = start
    elif rng is not None:
        shares = rng.dirichlet(np.ones(cells(hidden)), size=len(rows))
        description = identified(shares.reshape(len(rows), *map(len, hidden)))
    else:
        description = specification.identify(name=name)
    likelihoods: list[float] = []
    for _ in range(rounds):
        shares, each = _expected(description, terms, places, (len(rows), *map(len, hidden)))
        if np.isneginf(each[weight > 0]).any():
            row = rows[np.flatnonzero(np.isneginf(each) & (weight > 0))[0]]
            said = ", ".join(f"{v} = {v.values[place]}" for v, place in zip(observed, row, strict=True))
            raise ImpossibleEvidence(f"the datum {said} is impossible in {description}, whatever {text(hidden)}")
        likelihoods.append(float(weight @ np.where(weight > 0, each, 0.0)))
        if len(likelihoods) > 1 and abs(likelihoods[-1] - likelihoods[-2]) <= tolerance * weight.sum():
            return Identified(description, tuple(likelihoods), True)
        description = identified(shares)
    return Identified(description, tuple(likelihoods), False)


def _needed(specification: Specification, observed: frozenset[Variable]) -> list[Term]:
    """The terms that say something: others are over hidden variables that nothing depends on, and sum to 1."""
    terms = list(specification.terms)
    changed = True
    while changed:
        changed = False
        for term in terms:
            used = any(v in other.given for other in terms for v in term.of)
            if not used and observed.isdisjoint(term.of) and term not in specification.free:
                terms.remove(term)
                changed = True
                break
    return terms


def _places(
    observed: Sequence[Variable], hidden: Sequence[Variable], rows: NDArray[np.intp]
) -> dict[Variable, NDArray[np.intp]]:
    """For every variable an array that broadcasts over (datum, a hidden value for each hidden variable)."""
    places = {v: rows[:, k].reshape(-1, *(1 for _ in hidden)) for k, v in enumerate(observed)}
    for axis, v in enumerate(hidden):
        places[v] = np.arange(len(v)).reshape(1, *(len(v) if k == axis else 1 for k in range(len(hidden))))
    return places


def _expected(
    description: Description,
    terms: Sequence[Term],
    places: Mapping[Variable, NDArray[np.intp]],
    shape: tuple[int, ...],
) -> tuple[Array, Array]:
    """The probability of the hidden values for each datum, and the logarithm of each datum's own."""
    factors = description.relevant(Term(tuple(v for term in terms for v in term.of)))
    logs: Array = np.broadcast_to(reduce(np.add, (_log(factor, places) for factor in factors)), shape)
    axes = tuple(range(1, len(shape)))
    largest = logs.max(axis=axes, keepdims=True)
    scaled = np.exp(logs - np.where(np.isneginf(largest), 0.0, largest))
    total = scaled.sum(axis=axes, keepdims=True)
    with np.errstate(divide="ignore", invalid="ignore"):
        return scaled / total, (np.log(total) + largest).reshape(-1)


def _log(factor: Factor, places: Mapping[Variable, NDArray[np.intp]]) -> Array:
    """The logarithms of a factor for arrays of places, over their broadcast shape."""
    if isinstance(factor, Flat):
        return np.asarray(-np.log(cells(factor.of)))
    if isinstance(factor, Density):
        return np.asarray(factor.log(*(places[v] for v in factor.scope)))
    if isinstance(factor, Cases):
        command = places[factor.variable]
        branches = {id(branch): _log(branch, places) for branch in factor.branches}
        result: Array = np.asarray(0.0)
        for place, branch in enumerate(factor.branches):
            result = np.where(command == place, branches[id(branch)], result)
        return result
    table = logarithms(node(factor), factor.scope)
    at: Any = tuple(places[v] if length > 1 else 0 for v, length in zip(factor.scope, table.shape, strict=True))
    # nan is a question that has no answer there; a datum that would need one is impossible.
    return np.nan_to_num(table[at], nan=-np.inf, neginf=-np.inf)


def _identified(
    specification: Specification, name: str, places: Mapping[Variable, NDArray[np.intp]], shares: Array
) -> Description:
    """The description that the data make, each shared out among the hidden values."""
    kept = shares > CRUMB
    shared = {v: np.broadcast_to(column, shares.shape)[kept] for v, column in places.items()}
    samples = Samples(shared, int(kept.sum()), shares[kept])
    forms = {t: f.identify(t, samples) if f.free else f for t, f in specification.forms.items()}
    return Description(specification, forms, name)
