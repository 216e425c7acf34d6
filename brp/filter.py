"""Bayesian filters: X_t from X_t-1, a description asked again and again with its last answer put back in.

A description that speaks of now and before, P(X_t-1) P(X_t | X_t-1 ...) P(Z | X_t ...) or of any other shape,
becomes a filter when the belief takes the place of P(X_t-1). `Filter` carries the whole posterior on, exactly, or
goes on from the one value that was drawn. `Particles` carries a cloud of values on, where that is too large.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brp.description import Description, Specification
from brp.distribution import Distribution
from brp.errors import ImpossibleEvidence, QuestionError, SpecificationError
from brp.forms import Uniform
from brp.logs import logarithms
from brp.pointwise import in_order, log_at, proposed
from brp.variables import Term, Variable, cells, text

__all__ = ["Cloud", "Filter", "Particles"]

Array = NDArray[np.float64]

TINY = 1e-250


class Filter:
    """The exact filter of a description: P(Now | what is known now and was known before).

    ``carried`` says which variable of now becomes which of before: ``{Behavior: Before}``. ``known`` are the
    variables that are told at each step. `start` is the description's own P(Before), as a belief about now.
    """

    def __init__(
        self,
        description: Description,
        carried: Mapping[Variable, Variable],
        known: Variable | Iterable[Variable] = (),
    ) -> None:
        _check(description, carried)
        self.now, self.before = tuple(carried), tuple(carried.values())
        self.known = (known,) if isinstance(known, Variable) else tuple(known)
        # The belief takes the place of these terms. Uniform, they leave the weight of each value before as it is.
        replaced = [t for t in description.specification.terms if set(t.of) <= set(self.before)]
        foreign = [t for t in replaced if not set(t.given) <= set(self.before)]
        if foreign or {v for t in replaced for v in t.of} != set(self.before):
            raise SpecificationError(
                f"{text(self.before)} must have terms of their own in {description}, given nothing else: "
                "the belief takes their place"
            )
        forms = {t: Uniform() if t in replaced else description[t] for t in description.specification.terms}
        rest = Specification(forms, name=description.specification.name).identify(name=description.name)
        self.question = rest.ask(Term((*self.before, *self.now), self.known))
        self.start = Distribution(self.now, description.ask(Term(self.before))().p)

    def step(self, belief: Distribution, /, **known: Any) -> Distribution:
        """The belief about now, from the belief about what was now at the last step; axes as ``carried`` has them.

        Raises `ImpossibleEvidence` when what is known has probability zero under the belief.
        """
        if getattr(belief, "variables", None) != self.now:
            raise QuestionError(f"the filter carries a belief about {text(self.now)}, and not {belief!r}")
        size = cells(self.now)
        kernel = self.question(**known).p.reshape(size, size)
        before = belief.p.ravel()
        p: Array = before @ kernel
        total = p.sum()
        if not total > TINY:
            p = self._slowly(before, known)
            total = p.sum()
        return Distribution(self.now, (p / total).reshape(belief.p.shape))

    def follow(self, value: Any, /, **known: Any) -> Distribution:
        """The belief about now after the value that was drawn at the last step (a tuple of several)."""
        p = np.zeros(tuple(map(len, self.now)))
        p[self.start.place(value)] = 1
        return self.step(Distribution(self.now, p), **known)

    def __repr__(self) -> str:
        return _drawn(self)

    def _slowly(self, before: Array, known: Mapping[str, Any]) -> Array:
        """In logarithms: what is known is unlikely after what was believed, or impossible."""
        places = {v: v.place(known[v.keyword]) for v in self.known}
        logs = logarithms(self.question.simplified.start, self.question.searched, places)
        lengths = tuple(map(len, self.question.searched))
        kernel = np.broadcast_to(logs, lengths).reshape(len(before), -1)
        with np.errstate(divide="ignore"):
            joint = kernel + np.log(before)[:, None]
        largest = joint.max()
        if np.isneginf(largest):
            said = ", ".join(f"{v} = {known[v.keyword]}" for v in self.known)
            raise ImpossibleEvidence(
                f"{said or 'nothing known'} is impossible after what was believed about {text(self.now)}, in "
                f"{self.question.name}"
            )
        total: Array = np.exp(joint - largest).sum(axis=0)
        return total


@dataclass(frozen=True)
class Cloud:
    """A belief as particles: for each variable the places of their values, shape ``(n,)``, and their weights.

    The errors stated are those of so many weighted draws; what earlier steps have lost is not in them.
    """

    places: Mapping[Variable, NDArray[np.intp]]
    weights: Array

    @property
    def effective(self) -> float:
        """How many equally weighted particles would be worth as much."""
        return float(1 / (self.weights @ self.weights))

    def distribution(self, variable: Variable) -> tuple[Distribution, Array]:
        """The belief about one variable, and the standard error of each of its probabilities."""
        p = np.bincount(self.places[variable], self.weights, minlength=len(variable)).astype(np.float64)
        p /= p.sum()
        return Distribution((variable,), p), np.sqrt(p * (1 - p) / self.effective)

    def mean(self, variable: Variable) -> tuple[float, float]:
        """The expected value of a numeric variable, and its standard error."""
        x = variable.numbers[self.places[variable]]
        mean = float(self.weights @ x)
        return mean, float(np.sqrt(self.weights @ (x - mean) ** 2 / self.effective))


class Particles:
    """The same filter with a cloud of ``count`` values in the place of the posterior (a bootstrap particle filter).

    Every particle draws its value of now from the terms over ``carried``, given its value of before, and is weighed
    by the probability of what is known. All variables of the terms that matter are carried or known. No array of a
    step is over now and before together: each has at most ``count`` rows of the values of now.
    """

    def __init__(
        self,
        description: Description,
        carried: Mapping[Variable, Variable],
        known: Variable | Iterable[Variable] = (),
        *,
        count: int = 1000,
    ) -> None:
        _check(description, carried)
        self.now, self.before = tuple(carried), tuple(carried.values())
        self.known = (known,) if isinstance(known, Variable) else tuple(known)
        if count < 1:
            raise QuestionError(f"a cloud of {count} particles says nothing")
        self.count = count
        factors = description.relevant(Term((*self.now, *self.known)))
        self._prior = [f for f in factors if set(f.of) <= set(self.before)]
        self._rest = [f for f in factors if not set(f.of) <= set(self.before)]
        named = {*self.now, *self.before, *self.known}
        for factor in self._rest:
            foreign = [v for v in factor.scope if v not in named]
            if foreign:
                raise QuestionError(f"{factor} has {text(foreign)}, which the particles neither carry nor are told")
        self._rest = in_order(self._rest)

    def __repr__(self) -> str:
        return _drawn(self)

    def start(self, rng: np.random.Generator) -> Cloud:
        """The description's own P(Before), as a cloud about now."""
        places: dict[Variable, NDArray[np.intp]] = {}
        for factor in in_order(self._prior):
            places |= proposed(factor, places, self.count, rng)[0]
        carried = {now: places[before] for now, before in zip(self.now, self.before, strict=True)}
        return Cloud(carried, np.full(self.count, 1 / self.count))

    def step(self, cloud: Cloud, rng: np.random.Generator, /, **known: Any) -> Cloud:
        """The cloud about now. One whose weights have become too unequal is first drawn anew in proportion to them.

        Raises `ImpossibleEvidence` when no particle agrees with what is known; with more of them one might.
        """
        if known.keys() != {v.keyword for v in self.known}:
            raise QuestionError(f"the particles must be told {text(self.known) or 'nothing'} and nothing else")
        if cloud.effective < self.count / 2:
            cloud = _resampled(cloud, rng)
        told = {v: np.asarray(v.place(known[v.keyword])) for v in self.known}
        places = {v: np.broadcast_to(place, (self.count,)) for v, place in told.items()}
        places |= {b: cloud.places[n] for b, n in zip(self.before, self.now, strict=True)}
        with np.errstate(divide="ignore"):
            logs = np.log(cloud.weights)
        for factor in self._rest:
            if all(v in places for v in factor.of):
                logs = logs + log_at(factor, places)
            else:
                drawn, more = proposed(factor, places, self.count, rng)
                places |= drawn
                logs = logs + more
        largest = logs.max()
        if np.isneginf(largest):
            said = ", ".join(f"{v} = {known[v.keyword]}" for v in self.known)
            raise ImpossibleEvidence(f"none of {self.count} particles agrees with {said}")
        weights = np.exp(logs - largest)
        return Cloud({v: places[v] for v in self.now}, weights / weights.sum())


def _resampled(cloud: Cloud, rng: np.random.Generator) -> Cloud:
    """Systematic resampling: one uniform number, every particle as often as its weight says, give or take one."""
    count = len(cloud.weights)
    sums = np.cumsum(cloud.weights)
    who = np.searchsorted(sums, (np.arange(count) + rng.random()) / count * sums[-1], "right")
    who = np.minimum(who, np.flatnonzero(cloud.weights)[-1])
    return Cloud({v: places[who] for v, places in cloud.places.items()}, np.full(count, 1 / count))


def _drawn(which: Filter | Particles) -> str:
    carried = ", ".join(f"{now} becomes {before}" for now, before in zip(which.now, which.before, strict=True))
    return f"<{type(which).__name__}: {carried}; told {text(which.known) or 'nothing'}>"


def _check(description: Description, carried: Mapping[Variable, Variable]) -> None:
    if not isinstance(carried, Mapping):
        raise QuestionError(f"a filter wants a mapping from what is now to what was before, and not {carried!r}")
    if not carried:
        raise QuestionError("a filter carries at least one variable from now to before")
    for now, before in carried.items():
        if now.values != before.values:
            raise QuestionError(f"{now} cannot become {before}: their values differ")
        for v in (now, before):
            if v not in description.variables:
                raise QuestionError(f"{description} has no variable {v}; it has {text(description.variables)}")
