"""What a question answers: a probability for each value of what was searched."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Sequence
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from brp.errors import ImpossibleEvidence, QuestionError
from brp.functions import tabulate
from brp.propositions import Proposition
from brp.variables import Value, Variable, text

__all__ = ["Distribution"]


class Distribution:
    """A distribution over one or several variables; never changed.

    ``p`` is a read-only float64 array with one axis for each of ``variables``, in the order asked, and sums to one.
    What `draw`, `at` and `best` return is the bare value for one variable, and the tuple of values, in the order
    asked, for several: ``vrot, vtrans = motors(...).draw(rng)``. The same shape is the key of ``d[...]``.
    """

    __slots__ = ("_sums", "p", "variables")

    def __init__(self, variables: tuple[Variable, ...], p: NDArray[np.float64]) -> None:
        p.setflags(write=False)
        self.variables = variables
        self.p = p
        self._sums: NDArray[np.float64] | list[float] | None = None

    @property
    def values(self) -> Sequence[Any]:
        """The values that can be drawn, in the order of ``p.ravel()``: bare for one variable, else tuples."""
        if len(self.variables) == 1:
            return self.variables[0].values
        return list(product(*(variable.values for variable in self.variables)))

    def draw(self, rng: np.random.Generator) -> Any:
        """Draw(P(Searched | known)) of section 3.4; takes exactly one uniform number from ``rng``."""
        try:
            u = rng.random()
        except AttributeError:
            raise QuestionError(
                f"{rng!r} gives no uniform numbers: a draw takes a numpy.random.Generator"
            ) from None
        return self.at(u)

    def at(self, u: float) -> Any:
        """The value that the uniform number ``u`` in [0, 1) draws, so that a recorded draw can be made again.

        The values share [0, 1) in their order, each a stretch as long as its probability: one of probability zero
        has none and is never returned.
        """
        if not 0 <= u < 1:
            raise QuestionError(f"{u} is no uniform number: it must be in [0, 1)")
        sums = self._sums
        if sums is None:
            sums = self._sums = np.add.accumulate(self.p if self.p.ndim == 1 else self.p.ravel())
        elif not isinstance(sums, list):  # a list is searched faster, and worth making for whoever draws again
            sums = self._sums = sums.tolist()
        place = (
            bisect_right(sums, u * sums[-1]) if isinstance(sums, list) else sums.searchsorted(u * sums[-1], "right")
        )
        if place == len(sums):  # u times the total may round up to the total
            place = int(self.p.ravel().nonzero()[0][-1])
        return self._value(int(place))

    def best(self) -> Any:
        """The most probable value; the first of them when several are."""
        return self._value(int(self.p.argmax()))

    def mean(self) -> Any:
        """The expected value: a float, or a tuple of them for several variables; raises `NotNumeric` for words."""
        means = tuple(float(self.marginal(v).p @ v.numbers) for v in self.variables)
        return means[0] if len(means) == 1 else means

    def expect(self, utility: Callable[..., float] | ArrayLike) -> float:
        """The expected utility: a function of some of the variables by name, or an array shaped like ``p``."""
        if not callable(utility):
            worth = np.asarray(utility, dtype=np.float64)
            if worth.shape != self.p.shape:
                raise QuestionError(f"a utility of the shape {worth.shape} is not one of {text(self.variables)}")
            return float((self.p * worth).sum())
        used, worth = tabulate(utility, self.variables, f"the utility of {text(self.variables)}")
        return float((self.marginal(*used).p * worth).sum()) if used else float(worth)

    def probability(self, proposition: Proposition, given: Proposition | None = None) -> float:
        """The probability of a proposition about the variables, ``given`` another one if need be [E3.2].

        Raises `ImpossibleEvidence` when what is given has probability zero.
        """
        for part in (proposition, given):
            if part is None and part is given:
                continue
            if not isinstance(part, Proposition):
                raise QuestionError(f"{part!r} is no proposition: say {self.variables[0]}.is_(value), not ==")
            foreign = [v for v in part.variables if v not in self.variables]
            if foreign:
                raise QuestionError(f"{text(foreign)} is not among what was searched ({text(self.variables)})")
        truth = proposition.truth(self.variables)
        if given is None:
            return float(self.p[np.broadcast_to(truth, self.p.shape)].sum())
        within = np.broadcast_to(given.truth(self.variables), self.p.shape)
        total = float(self.p[within].sum())
        if total == 0:
            raise ImpossibleEvidence(f"{given} is impossible, and nothing can be said given that")
        return float(self.p[within & truth].sum()) / total

    def entropy(self) -> float:
        """The entropy in bits: 0 when one value is certain, log2 of their number when all are alike."""
        p = self.p[self.p > 0]
        return max(0.0, float(-(p @ np.log2(p))))

    def marginal(self, *variables: Variable) -> Distribution:
        """The distribution over some of the variables, in the order named [E3.6]."""
        for variable in variables:
            if variable not in self.variables:
                raise QuestionError(f"{variable} is not among what was searched ({text(self.variables)})")
        if not variables:
            raise QuestionError(f"a marginal is over one of {text(self.variables)} at least")
        if len(set(variables)) < len(variables):
            raise QuestionError(f"{text(variables)} has a variable twice")
        if variables == self.variables:
            return self
        kept = [self.variables.index(variable) for variable in variables]
        rest = tuple(axis for axis in range(self.p.ndim) if axis not in kept)
        order = sorted(kept)
        return Distribution(tuple(variables), self.p.sum(axis=rest).transpose([order.index(axis) for axis in kept]))

    def __getitem__(self, value: Any) -> float:
        return float(self.p[self.place(value)])

    __iter__ = None  # or Python would try d[0], d[1], ...; `values` and `p` are what can be gone through

    def place(self, value: Any) -> tuple[int, ...]:
        """Where a value stands in ``p``: its place for each variable."""
        parts = (value,) if len(self.variables) == 1 else value
        if not isinstance(parts, tuple | list) or len(parts) != len(self.variables):
            raise QuestionError(
                f"{value!r} is no value of {text(self.variables)}: it is a tuple, one value for each"
            )
        return tuple(v.place(part) for v, part in zip(self.variables, parts, strict=True))

    def _value(self, place: int) -> Any:
        if len(self.variables) == 1:
            return self.variables[0].values[place]
        places = np.unravel_index(place, self.p.shape)
        return tuple(v.values[int(i)] for v, i in zip(self.variables, places, strict=True))

    def __repr__(self) -> str:
        flat = self.p.ravel()
        few: list[tuple[Value, float]] = [(self._value(int(i)), float(flat[i])) for i in np.argsort(-flat)[:5]]
        shown = ", ".join(f"{value}: {p:.4g}" for value, p in few if p > 0)
        return f"<P({text(self.variables)}) {shown}{', ...' if flat.size > 5 else ''}>"
