"""Variables and terms: what a Bayesian program speaks about (sections 3.1 and 3.3).

>>> Dir = Variable("Dir", range(-10, 11))
>>> Prox = Variable("Prox", range(16))
>>> Vrot = Variable("Vrot", range(-10, 11))
>>> print(P(Vrot | Dir, Prox))
P(Vrot | Dir Prox)
"""

from __future__ import annotations

import keyword
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import isfinite
from typing import TYPE_CHECKING, Any, NoReturn

import numpy as np
from numpy.typing import NDArray

from brp.errors import NotAValue, NotNumeric, TermError

if TYPE_CHECKING:
    from brp.propositions import Proposition

__all__ = ["P", "Term", "Value", "Variable", "cells", "text"]

Value = int | float | str | bool
"""A value is a number, a truth, or one of the paper's words."""

NAME = re.compile(r"[A-Za-z][A-Za-z0-9_-]*")


class Variable:
    """A discrete variable: a name and its mutually exclusive, exhaustive values (section 3.1).

    ``values`` keeps the order given; whole numbers in even steps are a ``range``. ``keyword`` is the name as Python
    can write it: ``Behavior_t-1`` is printed so and known as ``Behavior_t_1=``. Two variables are equal when name
    and values are.
    """

    __slots__ = ("_hash", "_places", "keyword", "name", "values")

    def __init__(self, name: str, values: Iterable[Value]) -> None:
        if not isinstance(name, str) or not NAME.fullmatch(name):  # type: ignore[redundant-expr]  # a user's slip
            raise TermError(f"{name!r} is no name for a variable: write a letter, then letters, digits, _ or -")
        self.name = name
        self.keyword = name.replace("-", "_")
        if keyword.iskeyword(self.keyword):
            raise TermError(f"{name!r} is a word of Python and cannot name a variable")
        if isinstance(values, str | set | frozenset) or not isinstance(values, Iterable):
            raise TermError(f"{name} needs a sequence of values in their order, and was given {values!r}")
        self.values: Sequence[Value] = _sequence(values)
        if not self.values:
            raise TermError(f"{name} needs at least one value")
        self._places: dict[Any, int] | None = None
        if not isinstance(self.values, range) and len(self.places) != len(self.values):
            raise TermError(f"{name} has a value twice: {self.values}")
        self._hash = hash((name, self.values))

    @property
    def places(self) -> Mapping[Any, int]:
        """The place of each value among the values."""
        if self._places is None:
            self._places = {value: place for place, value in enumerate(self.values)}
        return self._places

    def place(self, value: object) -> int:
        """The place of ``value`` among the values; raises `NotAValue`."""
        try:
            if self._places is None and type(value) is int and isinstance(self.values, range):
                return self.values.index(value)  # millions of values need no dictionary
            return self.places[value]
        except (KeyError, TypeError, ValueError):
            raise NotAValue(f"{self.name} = {value!r} is not one of its values ({self.domain})") from None

    @property
    def domain(self) -> str:
        """The values as one reads them: ``-10..10``, or the words."""
        first, last = self.values[0], self.values[-1]
        if isinstance(self.values, range) and len(self.values) > 2:
            step = self.values.step
            return f"{first}..{last}" + (f" step {step}" if step != 1 else "")
        if len(self.values) > 12:
            return f"{first}, {self.values[1]}, ... {last}"
        return ", ".join(map(str, self.values))

    @property
    def numeric(self) -> bool:
        """Whether every value is a number (a truth is none)."""
        if isinstance(self.values, range):
            return True
        return all(isinstance(value, int | float) and not isinstance(value, bool) for value in self.values)

    @property
    def numbers(self) -> NDArray[np.float64]:
        """The values as numbers, shape ``(len(self),)``; raises `NotNumeric` when they are words."""
        if not self.numeric:
            raise NotNumeric(f"{self.name} has words for values ({self.domain}): no arithmetic can be done on it")
        if isinstance(self.values, range):
            return np.arange(self.values.start, self.values.stop, self.values.step, dtype=np.float64)
        return np.array(self.values, dtype=np.float64)

    def hidden(self) -> Variable:
        """A variable like this one that is equal to no other: for what a subroutine sums out on its own."""
        return _Hidden(self.name, self.values)

    def is_(self, *values: Value) -> Proposition:
        """The proposition that the variable has this value, or one of these (section 3.1)."""
        from brp.propositions import is_one_of  # they are about variables, and so come later

        return is_one_of(self, values)

    def __lt__(self, bound: float) -> Proposition:
        return self._compared("<", bound)

    def __le__(self, bound: float) -> Proposition:
        return self._compared("<=", bound)

    def __gt__(self, bound: float) -> Proposition:
        return self._compared(">", bound)

    def __ge__(self, bound: float) -> Proposition:
        return self._compared(">=", bound)

    def __and__(self, other: object) -> NoReturn:
        raise TermError(f"{self} alone is neither true nor false: write ({self} > 0) & ..., each between brackets")

    __rand__ = __and__

    def __invert__(self) -> NoReturn:
        raise TermError(f"{self} alone is neither true nor false: write ~({self} > 0), or ~{self}.is_(...)")

    def _compared(self, sign: str, bound: float) -> Proposition:
        from brp.propositions import compared

        return compared(self, sign, bound)

    def __len__(self) -> int:
        return len(self.values)

    def __bool__(self) -> bool:
        return True

    def __hash__(self) -> int:
        return self._hash

    def __eq__(self, other: object) -> bool:
        if self is other:
            return True
        return isinstance(other, Variable) and self.name == other.name and self.values == other.values

    def __reduce__(self) -> tuple[type[Variable], tuple[str, Sequence[Value]]]:
        return Variable, (self.name, self.values)

    def __or__(self, other: Variable | Iterable[Variable]) -> Bar:
        return Bar((self,), tuple(_flat(other)))

    def __ror__(self, other: Iterable[Variable]) -> Bar:
        return Bar(tuple(_flat(other)), (self,))

    def __str__(self) -> str:
        return self.name

    def __repr__(self) -> str:
        return f"Variable({self.name!r}, {self.values!r})"


class _Hidden(Variable):
    __slots__ = ()

    def __hash__(self) -> int:
        return self._hash

    def __eq__(self, other: object) -> bool:
        return self is other


@dataclass(frozen=True, repr=False)
class Bar:
    """What ``Vrot | Dir`` is before `P` has read the rest of the term."""

    of: tuple[Variable, ...]
    given: tuple[Variable, ...]

    def __or__(self, other: object) -> Bar:
        raise TermError(f"a term has one bar: write P({text(self.of)} | {text(self.given)}, ...)")

    def __repr__(self) -> str:
        return f"{text(self.of)} | {text(self.given)}"


@dataclass(frozen=True, repr=False)
class Term:
    """``P(of | given)``: a term of a decomposition, or what a question asks for. A value, in the order written."""

    of: tuple[Variable, ...]
    given: tuple[Variable, ...] = ()

    def __post_init__(self) -> None:
        if not self.of:
            raise TermError("a term needs a variable left of the bar")
        seen: set[Variable] = set()
        for variable in self.variables:
            if variable in seen:
                raise TermError(f"{variable} stands twice in {self}")
            seen.add(variable)

    @property
    def variables(self) -> tuple[Variable, ...]:
        """Left of the bar, then right of it."""
        return self.of + self.given

    def __str__(self) -> str:
        return f"P({text(self.of)} | {text(self.given)})" if self.given else f"P({text(self.of)})"

    __repr__ = __str__


def P(*parts: Variable | Bar | Iterable[Variable]) -> Term:
    """The term ``P(Vrot | Dir, Prox)``; several variables, or sequences of them, may stand on either side."""
    of: list[Variable] = []
    given: list[Variable] = []
    barred = False
    for part in parts:
        if isinstance(part, Bar):
            if barred:
                raise TermError(f"a term has one bar, and {text(part.of)} | {text(part.given)} is a second one")
            barred = True
            of.extend(part.of)
            given.extend(part.given)
        else:
            (given if barred else of).extend(_flat(part))
    return Term(tuple(of), tuple(given))


def text(words: Iterable[object]) -> str:
    """The words as a conjunction is printed: one blank for the paper's circled times."""
    return " ".join(map(str, words))


def cells(variables: Iterable[Variable]) -> int:
    """How many values the conjunction of the variables has."""
    count = 1
    for variable in variables:
        count *= len(variable.values)
    return count


def _flat(part: Any) -> Iterator[Variable]:
    if isinstance(part, Variable):
        yield part
        return
    if isinstance(part, str) or not isinstance(part, Iterable):
        raise TermError(f"{part!r} stands in a term, and is no variable")
    for inner in part:
        yield from _flat(inner)


def _sequence(values: Iterable[Value]) -> Sequence[Value]:
    if isinstance(values, range):
        return values
    listed = tuple(map(_plain, values))
    if len(listed) > 1 and all(type(value) is int for value in listed):
        first, second, last = int(listed[0]), int(listed[1]), int(listed[-1])
        even = range(first, last + (1 if second > first else -1), second - first or 1)
        if tuple(even) == listed:
            return even
    return listed


def _plain(value: Any) -> Value:
    """A number of numpy's becomes Python's, so that what is drawn can be printed and written as JSON."""
    plain = value.item() if isinstance(value, np.generic) else value
    if not isinstance(plain, int | float | str) or (isinstance(plain, float) and not isfinite(plain)):
        raise TermError(f"{plain!r} is no value for a variable: a value is a number, a truth or a word")
    return plain
