"""The forms of section 3.3: what P(of | given) is made of, and how data identify it.

A form is declared without saying of what: the term that it stands beside says that. ``factor`` turns a form and its
term into what the engine computes with; ``identify`` turns a form with free parameters into one without. A Question
is a form as well (the paper's Bayesian subroutine); it is defined with the questions, in `brp.description`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import reduce
from math import isfinite
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from brp.errors import SpecificationError
from brp.factors import Cases, Density, Factor, Flat
from brp.functions import Function, tabulate
from brp.samples import LARGEST, Samples
from brp.variables import Term, Value, Variable, cells

__all__ = ["Dirac", "Form", "Sigmoid", "Switch", "Table", "Uniform"]


class Form:
    """What a form has to say to the specification and to the engine."""

    free: bool = False
    """Whether it has parameters that only data can identify."""

    learns: bool = False
    """Whether samples change it: it is free, or was identified from samples and can take more."""

    names: tuple[str, ...] = ()
    """Of a question: the names of the description that it asks, as they stand right of the bar."""

    @property
    def inner(self) -> tuple[Form, ...]:
        """The forms that it is made of."""
        return ()

    def identify(self, term: Term, samples: Samples) -> Form:
        """The form without free parameters; itself when it has none."""
        return self

    def learn(self, term: Term, samples: Samples) -> Form:
        """The form after more samples: of a free form, as they identify it; itself when it does not learn."""
        return self.identify(term, samples)

    def factor(self, term: Term, names: tuple[str, ...]) -> Factor:
        """P(of | given) for the engine; raises `SpecificationError` when the form does not fit the term."""
        raise NotImplementedError


class Uniform(Form):
    """Every value of what is left of the bar is as probable as every other."""

    def factor(self, term: Term, names: tuple[str, ...]) -> Factor:
        """One flat factor; what is right of the bar does not matter to it."""
        return Flat(term.of, (), names)

    def __repr__(self) -> str:
        return "Uniform()"


class Table(Form):
    """Probabilities written out: an array, a mapping, or a function.

    * An array has one axis for each variable of the term in its order, left of the bar first: for ``P(H | Prox)``
      the shape ``(2, 16)``, so that a column is a distribution, as in the paper's tables.
    * A mapping goes from the values right of the bar (a tuple of them when they are several) to a mapping from
      values left of the bar to probabilities, or to a sequence of them; without a bar, directly so. A value that
      is not mentioned has probability zero.
    * A function takes some of the term's variables by name and returns the probability.

    ``"x"`` in place of a number is an equal share of what the numbers in its distribution leave, as in tables 2 to
    6 of the paper. Every distribution in it must sum to one (within 1e-6; it is then made exact).
    """

    def __init__(self, table: ArrayLike | Sequence[Any] | Mapping[Any, Any] | Callable[..., float]) -> None:
        self.table = table

    def factor(self, term: Term, names: tuple[str, ...]) -> Factor:
        """The table's logarithms."""
        given = term.given
        if not isinstance(self.table, np.ndarray) and cells(term.variables) > LARGEST and not callable(self.table):
            raise SpecificationError(f"the table of {term} would have {cells(term.variables)} numbers")
        if callable(self.table):
            used, p = tabulate(self.table, term.variables, f"the table of {term}")
            given = tuple(v for v in term.given if v in used)
            present = term.of + given
            p = np.broadcast_to(p.reshape([len(v) if v in used else 1 for v in present]), tuple(map(len, present)))
        elif isinstance(self.table, Mapping):
            p = _from_mapping(self.table, term)
        else:
            p = _numbers(self.table, term)
        shape = tuple(map(len, term.of + given))
        if p.shape != shape:
            raise SpecificationError(f"the table of {term} has the shape {p.shape}, and its variables want {shape}")
        p = _shared(p, len(term.of))
        _proper(p, term, given)
        p = p / p.sum(axis=tuple(range(len(term.of))))
        with np.errstate(divide="ignore"):
            logs = np.log(p)
        return Density(term.of, given, names, lambda *places: logs[places], vanishes=bool((p == 0).any()))

    def __repr__(self) -> str:
        return f"Table({self.table!r})"


class Sigmoid(Form):
    """A soft step for a variable of two values: P(value | x) = 1 / (1 + exp(-4 beta (x - alpha))).

    ``beta`` is the slope at ``alpha``, where both values are equally probable. The paper writes only
    Sigmoid(alpha, beta) [S7.5]; with the 4 it agrees with the prose of section 7.4 and with figures 5 and 7.
    """

    def __init__(self, value: Value, *, alpha: float, beta: float) -> None:
        self.value = value
        self.alpha = alpha
        self.beta = beta

    def factor(self, term: Term, names: tuple[str, ...]) -> Factor:
        """Both logarithms from the exponent, so that neither tail is lost."""
        if len(term.of) != 1 or len(term.of[0]) != 2 or len(term.given) != 1:
            raise SpecificationError(f"a Sigmoid is P(X | Y) for an X of two values and one Y, and not {term}")
        if not (isfinite(self.alpha) and isfinite(self.beta)):
            raise SpecificationError(f"the Sigmoid of {term} has an alpha or a beta that is no number")
        (of,), (given,) = term.of, term.given
        exponent = 4 * self.beta * (given.numbers - self.alpha)
        logs = np.empty((2, len(given)))
        place = of.place(self.value)
        logs[place] = -np.logaddexp(0, -exponent)
        logs[1 - place] = -np.logaddexp(0, exponent)
        return Density(term.of, term.given, names, lambda *places: logs[places], vanishes=False)

    def __repr__(self) -> str:
        return f"Sigmoid({self.value!r}, alpha={self.alpha}, beta={self.beta})"


class Dirac(Form):
    """One value for certain: a constant, or a function of some of the variables right of the bar, by name.

    For several variables left of the bar the value is the tuple of theirs.
    """

    def __init__(self, value: Value | tuple[Value, ...] | Callable[..., Any]) -> None:
        self.value = value

    def factor(self, term: Term, names: tuple[str, ...]) -> Factor:
        """Zero at the value, minus infinity elsewhere."""
        if callable(self.value):
            function = Function(self.value, term.given, f"the Dirac of {term}")
            used, rows = function.used, list(function.rows())
        else:
            used, rows = (), [self.value]
        if len(term.of) > 1 and not all(isinstance(row, tuple) and len(row) == len(term.of) for row in rows):
            raise SpecificationError(f"the Dirac of {term} wants a tuple of {len(term.of)} values")
        places: list[NDArray[np.intp]] = []
        for axis, variable in enumerate(term.of):
            column = [row if len(term.of) == 1 else row[axis] for row in rows]
            found = np.array([variable.place(value) for value in column], dtype=np.intp)
            places.append(found.reshape(tuple(map(len, used))))

        def log(*at: Any) -> NDArray[np.float64]:
            of, given = at[: len(term.of)], at[len(term.of) :]
            same = reduce(np.logical_and, (np.equal(o, p[given]) for o, p in zip(of, places, strict=True)))
            return np.where(same, 0.0, -np.inf)

        return Density(term.of, used, names, log, vanishes=cells(term.of) > 1)

    def __repr__(self) -> str:
        return f"Dirac({self.value!r})"


class Switch(Form):
    """Another form for each value of a command variable: the probabilistic if-then-else of lesson 7.

    ``cases`` maps every value of ``variable`` (a tuple of values shares one form) to a form for the term without
    the command variable at the right of the bar. A Question among the cases may know only some of what is there.
    """

    def __init__(self, variable: Variable, cases: Mapping[Any, Form]) -> None:
        if not (isinstance(variable, Variable) and isinstance(cases, Mapping)):  # type: ignore[redundant-expr]  # slips
            raise SpecificationError(
                f"a Switch wants a command variable and a mapping from its values, not {variable!r}, {cases!r}"
            )
        self.variable = variable
        self.cases = dict(cases)
        self._forms: dict[int, Form] = {}
        for key, form in self.cases.items():
            if not isinstance(form, Form):
                raise SpecificationError(f"the Switch on {variable} has {form!r} for {key}, which is no form")
            for value in key if isinstance(key, tuple) else (key,):
                place = variable.place(value)
                if place in self._forms:
                    raise SpecificationError(f"the Switch on {variable} has two cases for {value}")
                self._forms[place] = form
        missing = [str(v) for place, v in enumerate(variable.values) if place not in self._forms]
        if missing:
            raise SpecificationError(f"the Switch on {variable} has no case for {', '.join(missing)}")

    @property
    def free(self) -> bool:  # type: ignore[override]  # a Switch is free when one of its cases is
        """Whether one of the cases is free."""
        return any(form.free for form in self.cases.values())

    def identify(self, term: Term, samples: Samples) -> Switch:
        """Each case from the samples in which the command variable had its value."""
        within = self.within(term)
        return self._with(
            lambda form, places: form.identify(within, samples.where(self.variable, places)) if form.free else form
        )

    @property
    def inner(self) -> tuple[Form, ...]:
        """Its cases."""
        return tuple(self.cases.values())

    @property
    def learns(self) -> bool:  # type: ignore[override]  # likewise
        """Whether one of the cases learns."""
        return any(form.learns for form in self.cases.values())

    def learn(self, term: Term, samples: Samples) -> Switch:
        """Each case, with the samples in which the command variable had its value."""
        within = self.within(term)
        met = set(samples[self.variable].tolist())
        return self._with(
            lambda form, places: (
                form.learn(within, samples.where(self.variable, places))
                if form.free or not met.isdisjoint(places)
                else form
            )
        )

    def factor(self, term: Term, names: tuple[str, ...]) -> Factor:
        """The cases, side by side, each known by its values: ``P(Temp | winter pi-weather)``."""
        within = self.within(term)
        values: dict[int, list[Value]] = {}
        for place, value in enumerate(self.variable.values):
            values.setdefault(id(self._forms[place]), []).append(value)
        factors = {id(form): form.factor(within, (_case(values[id(form)]), *names)) for form in self.cases.values()}
        branches = tuple(factors[id(self._forms[place])] for place in range(len(self.variable)))
        return Cases(term.of, names, self.variable, branches)

    def _with(self, change: Callable[[Form, list[int]], Form]) -> Switch:
        """Each case changed, by a function of its form and the command variable's places that it is for."""
        cases = {}
        for key, form in self.cases.items():
            places = [self.variable.place(value) for value in (key if isinstance(key, tuple) else (key,))]
            cases[key] = change(form, places) if form.learns else form
        return Switch(self.variable, cases)

    def within(self, term: Term) -> Term:
        """The term that each case stands for: without the command variable at the right of the bar."""
        if self.variable not in term.given:
            raise SpecificationError(f"{term} switches on {self.variable}, which is not right of its bar")
        return Term(term.of, tuple(v for v in term.given if v != self.variable))

    def __repr__(self) -> str:
        return f"Switch({self.variable}, {self.cases!r})"


def _from_mapping(table: Mapping[Any, Any], term: Term) -> NDArray[np.float64]:
    p = np.zeros(tuple(map(len, term.variables)))
    if not term.given:
        _fill(p, table, term)
        return p
    filled = np.zeros(tuple(map(len, term.given)), dtype=bool)
    for key, column in table.items():
        parts = (key,) if len(term.given) == 1 else key
        if not isinstance(parts, tuple) or len(parts) != len(term.given):
            raise SpecificationError(f"the table of {term} has the key {key!r}; it wants one value for each given")
        at = tuple(v.place(part) for v, part in zip(term.given, parts, strict=True))
        _fill(p[(slice(None),) * len(term.of) + at], column, term)
        filled[at] = True
    if not filled.all():
        at = tuple(int(i) for i in np.argwhere(~filled)[0])
        raise SpecificationError(f"the table of {term} says nothing for {_where(term.given, at)}")
    return p


def _fill(p: NDArray[np.float64], column: Any, term: Term) -> None:
    if not isinstance(column, Mapping):
        p[...] = _numbers(column, term)
        return
    for key, probability in column.items():
        parts = (key,) if len(term.of) == 1 else key
        if not isinstance(parts, tuple) or len(parts) != len(term.of):
            raise SpecificationError(
                f"the table of {term} has the key {key!r}; it wants one value for each searched"
            )
        p[tuple(v.place(part) for v, part in zip(term.of, parts, strict=True))] = _numbers(probability, term)


def _numbers(table: Any, term: Term) -> NDArray[np.float64]:
    """Numbers, or nan where an "x" stands."""
    plain = isinstance(table, np.ndarray) and table.dtype.kind in "fiu"  # numbers already: no objects in between
    array = table if plain else np.asarray(table, dtype=object)
    marks = np.zeros(array.shape, dtype=bool) if plain else array == "x"
    try:
        p = np.where(marks, 0.0, array).astype(np.float64)
    except (TypeError, ValueError):
        raise SpecificationError(f'the table of {term} holds something that is neither a number nor "x"') from None
    if np.isnan(p).any():
        raise SpecificationError(f"the table of {term} holds something that is no probability")
    p[marks] = np.nan
    return p


def _shared(p: NDArray[np.float64], of: int) -> NDArray[np.float64]:
    """Each nan is replaced by an equal share of what the numbers of its distribution leave."""
    marks = np.isnan(p)
    if not marks.any():
        return p
    axes = tuple(range(of))
    shares = marks.sum(axis=axes)
    left = 1 - np.where(marks, 0.0, p).sum(axis=axes)
    # Decimals that sum to one may leave a crumb; what is more negative is refused as no probability.
    left = np.where(np.abs(left) < 1e-12, 0.0, left)
    share = np.divide(left, shares, out=np.zeros_like(left), where=shares > 0)
    return np.where(marks, share, p)


def _proper(p: NDArray[np.float64], term: Term, given: tuple[Variable, ...]) -> None:
    if not np.isfinite(p).all() or (p < 0).any():
        raise SpecificationError(f"the table of {term} holds something that is no probability")
    totals = p.sum(axis=tuple(range(len(term.of))))
    wrong = np.argwhere(np.abs(totals - 1) > 1e-6)
    if len(wrong):
        at = tuple(int(i) for i in wrong[0])
        where = f" for {_where(given, at)}" if given else ""
        raise SpecificationError(f"the table of {term} sums to {totals[at]:.6g}{where}, and must sum to 1")


def _case(values: Sequence[Value]) -> str:
    """What a case of a Switch is called among what is known."""
    return "/".join(map(str, values)) if len(values) <= 3 else f"{values[0]}/../{values[-1]}"


def _where(given: tuple[Variable, ...], at: tuple[int, ...]) -> str:
    return ", ".join(f"{v} = {v.values[place]}" for v, place in zip(given, at, strict=True))
