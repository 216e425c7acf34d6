"""Forms that count: Laplace succession laws and histograms, from how often each value was observed.

"A Laplace succession law on a variable V is defined by (1 + n_v) / (N + |V|), with N the total number of
observations, |V| the number of possible values for V and n_v the number of observations of the specific value v"
(footnote 16). Right of the bar there is a law of its own for every combination of values.
"""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from brp.errors import SpecificationError, Unidentified
from brp.factors import Density, Factor
from brp.forms import Form
from brp.nearest import Nearest, nearest
from brp.samples import Samples, empty, weighed
from brp.variables import Term, Variable, cells

__all__ = ["Counted", "Counting", "Histogram", "Laplace"]

Array = NDArray[np.float64]


class Counting(Form):
    """What both forms share: ``bins`` and the count of each value for each cell."""

    free = True
    learns = True
    add: float

    def __init__(self, bins: int | None) -> None:
        if bins is not None and bins < 1:
            raise SpecificationError(f"{type(self).__name__} needs at least one bin, and not {bins}")
        self.bins = bins

    def identify(self, term: Term, samples: Samples) -> Counted:
        """How often each value was observed with each combination of what is given."""
        counts = empty(term, self.size(term))
        return Counted(self, counts).learn(term, samples)

    def factor(self, term: Term, names: tuple[str, ...]) -> Factor:
        """As no data at all identify it."""
        return self.identify(term, Samples({}, 0)).factor(term, names)

    def size(self, term: Term) -> int:
        """How many counts there are for each cell; raises `SpecificationError` when bins do not fit the term."""
        if self.bins is None:
            return cells(term.of)
        if len(term.of) != 1 or self.bins > len(term.of[0]):
            raise SpecificationError(f"{self.bins} bins do not fit {term}: one variable of at least as many values")
        return self.bins

    def bin(self, of: tuple[Variable, ...], places: tuple[Any, ...]) -> Any:
        """In which count a value, or each of an array of values, belongs."""
        if self.bins is not None:
            return places[0] * self.bins // len(of[0])
        at: Any = 0
        for variable, place in zip(of, places, strict=True):
            at = at * len(variable) + place
        return at


class Laplace(Counting):
    """The Laplace succession law (n_v + 1) / (N + |V|): uniform before any data, never zero after.

    With ``bins`` the values of one variable are counted in that many neighbourhoods of equal width, whose values
    share their probability equally; |V| is then the number of bins.
    """

    add = 1.0

    def __init__(self, *, bins: int | None = None) -> None:
        super().__init__(bins)

    def __repr__(self) -> str:
        return f"Laplace({'' if self.bins is None else f'bins={self.bins}'})"


class Histogram(Counting):
    """The frequencies n_v / N: a value that was never observed is impossible.

    A cell that no sample visited answers as ``unvisited`` says: uniform, or as the `Nearest` one visited. ``bins``
    as for `Laplace`.
    """

    add = 0.0

    def __init__(self, *, bins: int | None = None, unvisited: Nearest | Literal["uniform"] = "uniform") -> None:
        super().__init__(bins)
        if unvisited != "uniform" and not isinstance(unvisited, Nearest):
            raise SpecificationError(f'a Histogram\'s unvisited is "uniform" or Nearest(), not {unvisited!r}')
        self.unvisited = unvisited

    def __repr__(self) -> str:
        bins = "" if self.bins is None else f"bins={self.bins}, "
        return f"Histogram({bins}unvisited={self.unvisited!r})"


class Counted(Form):
    """An identified Laplace law or histogram: its counts.

    ``counts`` has the shape (values or bins, then an axis for each given variable in the term's order); several
    variables left of the bar share the first axis, the last of them running fastest.
    """

    learns = True

    def __init__(self, form: Counting, counts: Array) -> None:
        self.form = form
        self.counts = counts

    def learn(self, term: Term, samples: Samples) -> Counted:
        """The counts with more samples; refuses to remove what was never counted."""
        bins = self.form.bin(term.of, tuple(samples[v] for v in term.of))
        at = bins * cells(term.given) + samples.cells(term.given)
        return Counted(self.form, weighed(self.counts, at, samples.weights, term))

    def probabilities(self, term: Term) -> Array:
        """The probability of each value or bin for each cell, in the shape of ``counts``."""
        total = self.counts.sum(axis=0)
        size = len(self.counts)
        add = self.form.add
        if add:
            smoothed: Array = (self.counts + add) / (total + add * size)
            return smoothed
        visited = total > 0
        if not visited.any():
            raise Unidentified(f"no data has identified {term}: call identify(samples) with some")
        p: Array = np.divide(self.counts, total, out=np.full_like(self.counts, 1 / size), where=visited)
        rule = getattr(self.form, "unvisited", "uniform")
        if isinstance(rule, Nearest) and term.given:
            answers: tuple[Any, ...] = nearest(visited, term.given, rule, f"the border of {term}")
            p = p[(slice(None), *answers)]
        return p

    def factor(self, term: Term, names: tuple[str, ...]) -> Factor:
        """The logarithms of the counts' shares, looked up where they are asked."""
        form, n = self.form, len(term.of)
        with np.errstate(divide="ignore"):
            logs = np.log(self.probabilities(term))
        if form.bins is not None:
            width = np.bincount(form.bin(term.of, (np.arange(len(term.of[0])),)))
            logs = logs - np.log(width).reshape(-1, *(1 for _ in term.given))

        def log(*places: Any) -> Array:
            found: Array = logs[(form.bin(term.of, places[:n]), *places[n:])]
            return found

        # More data may make any probability of a histogram zero or not; its questions keep their plan either way.
        return Density(term.of, term.given, names, log, vanishes=not form.add)

    def __repr__(self) -> str:
        visited = int((self.counts.sum(axis=0) > 0).sum())
        return f"<{self.form!r} identified from {self.counts.sum():g} samples in {visited} cells>"
