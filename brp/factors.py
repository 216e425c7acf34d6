"""What a form hands to the engine: the logarithms of a conditional distribution, and what is known of its shape.

A factor is P(of | given) with everything identified. Its ``given`` are only those that it really depends on. The
logarithms come from the form itself: the logarithm of a probability that has underflowed to zero would be wrong.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from brp.variables import Variable, text

__all__ = ["Cases", "Density", "Factor", "Flat", "label"]

Logs = NDArray[np.float64]
Places = Any
"""A value's place, or an array of places; several of them broadcast."""


class LaidOut(NamedTuple):
    """A table as a compiled question looks it up."""

    values: NDArray[np.float64]
    """Probabilities, or what is proportional to them; the known variables' axes, then the shape that was asked.
    Not to be written into: several questions may have it."""
    axes: tuple[Variable, ...]
    """What it depends on, the known variables first."""
    known: int
    """How many these are."""
    gaps: bool
    """Whether it has a nan."""


class Factor:
    """P(of | given), normalised over ``of`` for every value of ``given``.

    ``names`` are the data set and the specification that stand at the right of every term (``delta-push``,
    ``pi-obstacle``). ``vanishes`` says whether a probability of zero is among its values.
    """

    vanishes: bool = False

    def __init__(self, of: tuple[Variable, ...], given: tuple[Variable, ...], names: tuple[str, ...]) -> None:
        self.of = of
        self.given = given
        self.names = names

    @property
    def scope(self) -> tuple[Variable, ...]:
        """Left of the bar, then right of it."""
        return self.of + self.given

    def renamed(self, new: Mapping[Variable, Variable]) -> Factor:
        """The same factor over other variables."""
        raise NotImplementedError

    def __str__(self) -> str:
        return label(self.of, self.given, self.names)


class Flat(Factor):
    """The same probability for every value."""

    def renamed(self, new: Mapping[Variable, Variable]) -> Flat:
        """The same factor over other variables."""
        return Flat(_rename(self.of, new), _rename(self.given, new), self.names)


class Density(Factor):
    """A factor given by a function from places to logarithms.

    ``log`` takes one argument for each variable of `scope`, a place or an array of places, and returns the natural
    logarithms of the probabilities over their broadcast shape. A ``light`` one holds far fewer numbers than its
    table would: it is rather computed where it is asked than written out.
    """

    def __init__(
        self,
        of: tuple[Variable, ...],
        given: tuple[Variable, ...],
        names: tuple[str, ...],
        log: Callable[..., Logs],
        *,
        vanishes: bool,
        light: bool = False,
    ) -> None:
        super().__init__(of, given, names)
        self.log = log
        self.vanishes = vanishes
        self.light = light
        self.laid_out: dict[Hashable, LaidOut] = {}
        """The table in every order in which questions wanted it, so that they share it."""

    @cached_property
    def table(self) -> Logs:
        """The logarithms for all values, an axis for each variable of `scope`."""
        mesh = np.ix_(*(np.arange(len(variable)) for variable in self.scope))
        logs = self.log(*mesh)
        return np.broadcast_to(logs, tuple(map(len, self.scope)))

    def renamed(self, new: Mapping[Variable, Variable]) -> Density:
        """The same factor over other variables."""
        of, given = _rename(self.of, new), _rename(self.given, new)
        return Density(of, given, self.names, self.log, vanishes=self.vanishes, light=self.light)


class Cases(Factor):
    """Another factor for each value of one of the given variables: kept as cases, never as one table."""

    def __init__(
        self, of: tuple[Variable, ...], names: tuple[str, ...], variable: Variable, branches: tuple[Factor, ...]
    ) -> None:
        given = {variable: None} | {v: None for branch in branches for v in branch.given}
        super().__init__(of, tuple(given), names)
        self.variable = variable
        self.branches = branches
        self.vanishes = any(branch.vanishes for branch in branches)

    def renamed(self, new: Mapping[Variable, Variable]) -> Cases:
        """The same factor over other variables."""
        branches = tuple(branch.renamed(new) for branch in self.branches)
        return Cases(_rename(self.of, new), self.names, new.get(self.variable, self.variable), branches)


def label(
    of: tuple[Variable, ...],
    given: tuple[Variable, ...],
    names: tuple[str, ...],
    fixed: Mapping[Variable, int] | None = None,
) -> str:
    """``P(avoidance | Prox pi-home)``: a term as the paper prints it, with the value of what is fixed."""
    fixed = fixed or {}

    def words(variables: tuple[Variable, ...]) -> list[object]:
        return [v.values[fixed[v]] if v in fixed else v for v in variables]

    right = [*words(given), *names]
    return f"P({text(words(of))} | {text(right)})" if right else f"P({text(words(of))})"


def _rename(variables: tuple[Variable, ...], new: Mapping[Variable, Variable]) -> tuple[Variable, ...]:
    return tuple(new.get(variable, variable) for variable in variables)
