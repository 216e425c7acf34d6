"""Monte-Carlo answers: importance sampling, where an exact answer is refused or too slow. They state their error.

Every sample draws the variables of the description one term after the other, each given those before it. What is
known is not drawn: the sample weighs as much as its probability (likelihood weighting).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brp.description import Description
from brp.distribution import Distribution
from brp.errors import ImpossibleEvidence, QuestionError, TooLarge
from brp.evidence import Signature
from brp.factors import label
from brp.pointwise import in_order, proposed
from brp.variables import Term, Variable, cells, text

__all__ = ["Estimate", "Sampling"]

Array = NDArray[np.float64]

BATCH = 10_000
"""How many samples are drawn together."""
LARGEST = 32_000_000
"""How many values what is searched may have."""


@dataclass(frozen=True)
class Estimate:
    """An approximate answer. ``errors`` has the standard error of each probability, in the shape of ``p``.

    ``count`` samples were drawn; ``effective`` is how many draws from the answer itself would be worth as much. A
    value that no sample met has probability and error 0: its probability is below 3 / ``effective`` with 95 %
    confidence. Errors are themselves estimates, and poor ones where ``effective`` is small.
    """

    distribution: Distribution
    errors: Array
    effective: float
    count: int


class Sampling:
    """P(Searched | Known) of a description by samples: ``Sampling(description, P(O | Per)).ask(rng, Per=700)``."""

    def __init__(self, description: Description, term: Term) -> None:
        if not isinstance(term, Term):
            raise QuestionError(f"{description} is asked {term!r}, and wants a term: P(Searched | Known)")
        missing = [v for v in term.variables if v not in description.variables]
        if missing:
            raise QuestionError(
                f"{description} has no variable {text(missing)}; it has {text(description.variables)}"
            )
        if cells(term.of) > LARGEST:
            raise TooLarge(f"{text(term.of)} have {cells(term.of)} values together, more than {LARGEST}")
        self.term = term
        self.description = description
        self._factors = in_order(description.relevant(term))
        self._name = str(term)

    def __repr__(self) -> str:
        return f"<Sampling {label(self.term.of, self.term.given, self.description.names)}>"

    def ask(
        self, rng: np.random.Generator, /, count: int = BATCH, *, error: float | None = None, **known: Any
    ) -> Estimate:
        """The estimate of ``count`` samples, or of as many fewer as bring every standard error below ``error``.

        Raises `ImpossibleEvidence` when no sample agrees with what is known: it is impossible, or too unlikely for
        so few samples. A variable named ``count`` or ``error`` cannot be told.
        """
        told = dict(Signature(self._name, self.term.given, ()).read(known).places)
        if count < 1:
            raise QuestionError(f"{count} samples say nothing")
        size = cells(self.term.of)
        shift = -np.inf  # the largest logarithm so far: all sums are in units of its exponential
        first, second = np.zeros(size), np.zeros(size)
        done = 0
        while done < count:
            batch = min(BATCH, count - done)
            at, logs = self._drawn(told, batch, rng)
            done += batch
            largest = logs.max()
            if np.isneginf(largest):
                continue
            if largest > shift:
                first, second = first * np.exp(shift - largest), second * np.exp(2 * (shift - largest))
                shift = largest
            weights = np.exp(logs - shift)
            first += np.bincount(at, weights, minlength=size)
            second += np.bincount(at, weights * weights, minlength=size)
            if error is not None and _errors(first, second).max() <= error and second.sum() > 0:
                break
        total = first.sum()
        if not total > 0:
            said = ", ".join(f"{v} = {known[v.keyword]}" for v in self.term.given)
            raise ImpossibleEvidence(
                f"none of {done} samples of {self._name} agrees with {said}: it is impossible or too unlikely for "
                "so few; raise count"
            )
        shape = tuple(map(len, self.term.of))
        answer = Distribution(self.term.of, (first / total).reshape(shape))
        return Estimate(answer, _errors(first, second).reshape(shape), float(total**2 / second.sum()), done)

    def _drawn(
        self, told: dict[Variable, int], count: int, rng: np.random.Generator
    ) -> tuple[NDArray[np.intp], Array]:
        """The cell of what is searched and the logarithm of the weight, for each sample."""
        places = {v: np.full(count, place, dtype=np.intp) for v, place in told.items()}
        logs = np.zeros(count)
        for factor in self._factors:
            drawn, more = proposed(factor, places, count, rng)
            places |= drawn
            logs = logs + more
        return _cell(self.term.of, [places[v] for v in self.term.of]), logs


def _errors(first: Array, second: Array) -> Array:
    """Standard errors of a ratio of weighted sums: sqrt(sum w^2 (1[x] - p)^2) / sum w."""
    total = first.sum()
    if not total > 0:
        return np.full_like(first, np.inf)
    p = first / total
    return np.asarray(np.sqrt(second * (1 - p) ** 2 + (second.sum() - second).clip(0) * p * p) / total)


def _cell(variables: Sequence[Variable], places: Sequence[NDArray[np.intp]]) -> NDArray[np.intp]:
    at = np.zeros_like(places[0])
    for variable, place in zip(variables, places, strict=True):
        at = at * len(variable) + place
    return at
