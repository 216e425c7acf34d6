"""Multi-resolution binary trees (MRBT): a distribution over a large numeric domain, finer where more of it is.

The domain is halved and halved again. A leaf is a stretch of neighbouring values that share its probability
equally; the leaf that may be most wrong is halved next. So a distribution over millions of values is held, and
computed, at a few hundred of them. The paper names the representation (section 3.4) and does not print it; this one
is ours.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brp.description import Description
from brp.distribution import Distribution
from brp.errors import ImpossibleEvidence, QuestionError, TooLarge
from brp.evidence import Signature
from brp.pointwise import log_at
from brp.variables import Term, Variable, cells, text

__all__ = ["Tree", "grow", "tree"]

Array = NDArray[np.float64]
Logs = Callable[[NDArray[np.intp]], Array]
"""From places, shape ``(n,)``, to logarithms of probabilities up to a common constant, shape ``(n,)``."""

LARGEST = 50_000_000
"""How many logarithms are held at a time."""


class Tree:
    """A distribution over one numeric variable as the leaves of a binary tree; never changed.

    ``starts`` has the place at which each leaf starts, in order, and ``masses`` its probability. ``error`` bounds
    the total variation between this and the exact distribution, if that one rises or falls steadily between the
    places that were looked at (the ends and the middle of every leaf): a peak that hides between them is not in it.
    """

    def __init__(self, variable: Variable, starts: NDArray[np.intp], masses: Array, error: float) -> None:
        self.variable = variable
        self.starts = starts
        self.masses = masses
        self.error = error
        self.sizes = np.diff(starts, append=len(variable))
        self._sums = np.cumsum(masses)

    def __getitem__(self, value: Any) -> float:
        leaf = int(np.searchsorted(self.starts, self.variable.place(value), "right")) - 1
        return float(self.masses[leaf] / self.sizes[leaf])

    def draw(self, rng: np.random.Generator) -> Any:
        """A value drawn from it; takes exactly one uniform number."""
        return self.at(rng.random())

    def at(self, u: float) -> Any:
        """The value that the uniform number ``u`` in [0, 1) draws: first the leaf, then the value within it."""
        total = self._sums[-1]
        leaf = int(np.searchsorted(self._sums, u * total, "right"))
        if leaf == len(self._sums):  # u times the total may round up to the total
            leaf = int(np.flatnonzero(self.masses)[-1])
        within = (u * total - (self._sums[leaf] - self.masses[leaf])) / self.masses[leaf]
        place = int(self.starts[leaf]) + min(int(self.sizes[leaf]) - 1, max(0, int(within * self.sizes[leaf])))
        return self.variable.values[place]

    def best(self) -> Any:
        """A most probable value: the middle of the densest leaf."""
        leaf = int(np.argmax(self.masses / self.sizes))
        return self.variable.values[int(self.starts[leaf] + (self.sizes[leaf] - 1) // 2)]

    def mean(self) -> float:
        """The expected value."""
        first, last = self._value(self.starts), self._value(self.starts + self.sizes - 1)
        return float(self.masses @ (first + last) / 2)

    def distribution(self) -> Distribution:
        """Written out over all values."""
        return Distribution((self.variable,), np.repeat(self.masses / self.sizes, self.sizes))

    def _value(self, places: NDArray[np.intp]) -> Array:
        values = self.variable.values
        assert isinstance(values, range)
        return values.start + values.step * places.astype(np.float64)

    def __repr__(self) -> str:
        return f"<P({self.variable}) in {len(self.masses)} leaves, error at most {self.error:.2g}>"


def grow(variable: Variable, logs: Logs, *, error: float = 0.01, most: int = 4096, first: int = 64) -> Tree:
    """The tree of the distribution that ``logs`` gives, up to a constant, at any places.

    It begins with about ``first`` leaves of equal size and halves the worst ones until ``error`` is reached or
    there are ``most`` leaves. What is narrower than one of the first leaves is found if the way to it rises.
    """
    if not isinstance(variable.values, range):
        raise QuestionError(
            f"a tree is for whole numbers in even steps, and not for {variable} ({variable.domain})"
        )
    edges = np.unique(np.linspace(0, len(variable), min(first, len(variable)) + 1).astype(np.intp))
    low, high = edges[:-1], edges[1:] - 1
    at = _look(logs, low, high)
    while True:
        largest = at.max()
        if np.isneginf(largest):
            raise ImpossibleEvidence(f"no value of {variable} that was looked at has a probability above zero")
        p, size = np.exp(at - largest), high - low + 1
        mass, wrong = _weigh(p, size)
        total = mass.sum()
        # Half of the sum is the variation before normalising, and normalising may add as much again.
        bound = float(wrong.sum() / total)
        worst = np.flatnonzero(wrong > 0)
        if bound <= error or not len(worst) or len(low) >= most:
            return Tree(variable, low, mass / total, min(1.0, bound))
        worst = worst[np.argsort(-wrong[worst], kind="stable")][: min(max(1, len(worst) // 4), most - len(low))]
        middle = (low[worst] + high[worst]) // 2
        children_low = np.concatenate((low[worst], middle + 1))
        children_high = np.concatenate((middle, high[worst]))
        kept = np.ones(len(low), dtype=bool)
        kept[worst] = False
        low = np.concatenate((low[kept], children_low))
        high = np.concatenate((high[kept], children_high))
        at = np.concatenate((at[:, kept], _look(logs, children_low, children_high)), axis=1)
        order = np.argsort(low)
        low, high, at = low[order], high[order], at[:, order]


def tree(
    description: Description,
    term: Term,
    known: Mapping[str, Any] | None = None,
    *,
    error: float = 0.01,
    most: int = 4096,
    first: int = 64,
) -> Tree:
    """P(X | Known) for one numeric ``X`` of many values, as a tree; ``known`` has each known value by keyword.

    Unknown variables are summed out place by place, so they may have few values together (`TooLarge` otherwise).
    """
    if not isinstance(term, Term):
        raise QuestionError(f"{description} is asked {term!r}, and wants a term: P(X | Known)")
    missing = [v for v in term.variables if v not in description.variables]
    if missing:
        raise QuestionError(f"{description} has no variable {text(missing)}; it has {text(description.variables)}")
    if len(term.of) != 1:
        raise QuestionError(f"a tree is over one variable, and {term} searches {text(term.of)}")
    told = Signature(str(term), term.given, ()).read(known or {}).places
    (variable,) = term.of
    factors = description.relevant(term)
    unknown = [v for v in dict.fromkeys(v for f in factors for v in f.scope) if v not in term.variables]
    if cells(unknown) * 3 * max(first, most) > LARGEST:
        raise TooLarge(
            f"{text(unknown)} have {cells(unknown)} values together, too many to be summed at each place"
        )
    places: dict[Variable, NDArray[np.intp]] = {v: np.asarray(place) for v, place in told.items()}
    for axis, v in enumerate(unknown):
        places[v] = np.arange(len(v)).reshape(1, *(len(v) if k == axis else 1 for k in range(len(unknown))))
    lengths = tuple(map(len, unknown))

    def logs(at: NDArray[np.intp]) -> Array:
        here = places | {variable: at.reshape(-1, *(1 for _ in unknown))}
        total: Array = np.zeros((len(at), *lengths))
        for factor in factors:
            total = total + log_at(factor, here)
        flat = total.reshape(len(at), -1)
        largest = flat.max(axis=1)
        shift = np.where(np.isneginf(largest), 0.0, largest)
        with np.errstate(divide="ignore"):
            return np.asarray(np.log(np.exp(flat - shift[:, None]).sum(axis=1)) + shift)

    return grow(variable, logs, error=error, most=most, first=first)


def _look(logs: Logs, low: NDArray[np.intp], high: NDArray[np.intp]) -> Array:
    """The logarithms at the first, middle and last place of each leaf, shape ``(3, leaves)``."""
    return logs(np.concatenate((low, (low + high) // 2, high))).reshape(3, -1)


def _weigh(p: Array, size: NDArray[np.intp]) -> tuple[Array, Array]:
    """What each leaf holds and how wrong its values may be together, from three places and the number of values."""
    first, middle, last = p
    # The middle counts for the values on both sides of it; up to three values are all looked at.
    mass = np.select(
        [size == 1, size == 2, size == 3],
        [first, first + last, first + middle + last],
        (first + 2 * middle + last) / 4 * size,
    )
    wrong = np.where(size == 1, 0.0, size * (p.max(axis=0) - p.min(axis=0)))
    return mass, wrong
