"""Logical propositions (section 3.1): that a variable has this value or that, joined by ``&``, ``|`` and ``~``.

>>> from brp.variables import Variable
>>> Dir, Prox = Variable("Dir", range(-10, 11)), Variable("Prox", range(16))
>>> print(Dir.is_(3) & ~(Prox > 8))
(Dir = 3) ∧ ¬(Prox > 8)

A variable keeps its ordinary equality, since terms are keys: ``Dir == 3`` is not the way to say that Dir is 3.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NoReturn

import numpy as np
from numpy.typing import NDArray

from brp.errors import TermError
from brp.variables import Variable

__all__ = ["Proposition", "compared", "is_one_of"]

Truth = NDArray[np.bool_]


class Proposition:
    """True or false for each combination of values of its ``variables``."""

    def __init__(
        self, variables: tuple[Variable, ...], truth: Callable[[Sequence[Variable]], Truth], said: str
    ) -> None:
        self.variables = variables
        self._truth = truth
        self._said = said

    def truth(self, order: Sequence[Variable]) -> Truth:
        """Where it is true: an axis for each of ``order``, of length 1 for those that do not matter."""
        return self._truth(order)

    def __and__(self, other: Proposition) -> Proposition:
        return self._joined(other, np.logical_and, "∧")

    def __or__(self, other: Proposition) -> Proposition:
        return self._joined(other, np.logical_or, "∨")

    def __invert__(self) -> Proposition:
        return Proposition(self.variables, lambda order: np.logical_not(self.truth(order)), f"¬({self._said})")

    def __bool__(self) -> NoReturn:
        raise TermError(f"whether {self} is not settled; join propositions by &, | and ~, each between brackets")

    def _joined(self, other: Proposition, join: Any, sign: str) -> Proposition:
        if not isinstance(other, Proposition):
            return NotImplemented
        variables = tuple(dict.fromkeys((*self.variables, *other.variables)))
        words = [p._said if p._said.startswith("¬") else f"({p._said})" for p in (self, other)]
        return Proposition(
            variables, lambda order: join(self.truth(order), other.truth(order)), f" {sign} ".join(words)
        )

    def __str__(self) -> str:
        return self._said

    def __repr__(self) -> str:
        return f"<Proposition {self._said}>"


def is_one_of(variable: Variable, values: Sequence[Any]) -> Proposition:
    """That the variable has one of these values; raises `NotAValue`."""
    if not values:
        raise TermError(f"{variable}.is_() wants a value")
    mask = np.zeros(len(variable), dtype=bool)
    mask[[variable.place(value) for value in values]] = True
    said = f"{variable} = {values[0]}" if len(values) == 1 else f"{variable} in {{{', '.join(map(str, values))}}}"
    return _atom(variable, mask, said)


def compared(variable: Variable, sign: str, bound: float) -> Proposition:
    """That the variable is less or more than a number; raises `NotNumeric` for words."""
    numbers = variable.numbers
    if not isinstance(bound, int | float | np.number):
        raise TermError(f"{variable} {sign} {bound}: a variable can be compared with a number only")
    masks: dict[str, Callable[[], Any]] = {
        "<": lambda: numbers < bound,
        "<=": lambda: numbers <= bound,
        ">": lambda: numbers > bound,
        ">=": lambda: numbers >= bound,
    }
    return _atom(variable, np.asarray(masks[sign]()), f"{variable} {sign} {bound}")


def _atom(variable: Variable, mask: Truth, said: str) -> Proposition:
    def truth(order: Sequence[Variable]) -> Truth:
        return mask.reshape([len(v) if v == variable else 1 for v in order])

    return Proposition((variable,), truth, said)
