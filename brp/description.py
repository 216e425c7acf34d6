"""Specification, description, question: the three things of a Bayesian program (section 3.3, figure 1).

A specification (the paper's preliminary knowledge) is a decomposition with a form for each of its terms. Identified
with data it is a description, and a description can be asked.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from math import inf
from typing import Any, NoReturn

from numpy.typing import ArrayLike

from brp.errors import DataError, QuestionError, SpecificationError
from brp.factors import Factor, label
from brp.forms import Form
from brp.question import LARGEST, Question
from brp.renewal import Plan
from brp.samples import Data, Samples
from brp.variables import Term, Variable, text

__all__ = ["Description", "Specification"]


class Specification:
    """Preliminary knowledge: the decomposition at the left, a form for each of its terms at the right.

    Raises `SpecificationError` with a sentence when the terms are no decomposition of a joint distribution [E3.9]
    or a form does not fit its term. It cannot be asked: `identify` makes it a `Description`.
    """

    def __init__(self, forms: Mapping[Term, Form], *, name: str = "") -> None:
        self.name = name
        if not isinstance(forms, Mapping):
            raise SpecificationError(f"{self} wants a mapping from its terms to their forms, and got {forms!r}")
        self.forms = dict(forms)
        _check(self)
        self.terms: tuple[Term, ...] = tuple(self.forms)
        self.variables: tuple[Variable, ...] = tuple(v for term in self.terms for v in term.of)
        names = (name,) if name else ()
        self._factors: dict[Term, Factor] = {}
        for term, form in self.forms.items():
            if form.free:
                form.identify(term, Samples({}, 0))  # refuses here what does not fit
            else:
                self._factors[term] = form.factor(term, names)

    @property
    def free(self) -> tuple[Term, ...]:
        """The terms whose forms have parameters that only data can identify."""
        return tuple(term for term, form in self.forms.items() if form.free)

    def identify(
        self,
        samples: Data | None = None,
        *,
        name: str = "",
        weights: ArrayLike | None = None,
        parameters: Mapping[Term, Form] | None = None,
    ) -> Description:
        """The description that ``samples`` make of it; ``name`` is the data set's (``delta-push``).

        ``samples`` are columns (a mapping from a variable's name to its values) or rows (mappings); ``weights``,
        one number for each, say how many observations each counts as (1 unless told). ``parameters`` says of some
        free terms what they are, in place of the data: a table written by hand for a taught one.
        """
        given = dict(parameters or {})
        for term, form in given.items():
            if term not in self.free:
                raise SpecificationError(f"{term} of {self} has no free parameters that could be given")
            if not isinstance(form, Form):
                raise SpecificationError(f"{term} of {self} is given {form!r}, which is no form")
        needed = {v for term in self.free if term not in given for v in term.variables}
        read = Samples.of(samples, [v for v in self.variables if v in needed], weights)
        if (read.weights < 0).any():
            raise DataError(
                "a sample to identify from weighs less than nothing; description.forget(datum) removes one"
            )
        forms = {
            term: given[term]
            if term in given
            else form.identify(term, read)
            if form.free and samples is not None
            else form
            for term, form in self.forms.items()
        }
        return Description(self, forms, name)

    def ask(self, *_: object, **__: object) -> NoReturn:
        """Refused: only a description can be asked."""
        raise QuestionError(f"{self} has met no data, and cannot be asked: identify() makes it a description")

    def __str__(self) -> str:
        return self.name or "a specification without a name"

    def __repr__(self) -> str:
        return _drawn(f"Specification {self}", self.variables, self.forms)


class Description:
    """A specification whose free parameters are identified: a joint distribution, ready to be asked.

    It is never changed; other data make another description, as `learn` does.
    """

    def __init__(self, specification: Specification, forms: Mapping[Term, Form], name: str) -> None:
        self.specification = specification
        self.name = name
        self._forms = dict(forms)
        self._factors: dict[Term, Factor] = {}
        self._questions: dict[tuple[Term, tuple[Variable, ...], int], Question] = {}
        self._plans: dict[tuple[Term, tuple[Variable, ...], int], Plan] = {}

    @property
    def names(self) -> tuple[str, ...]:
        """The data set and the specification, as they stand at the right of a question."""
        return tuple(name for name in (self.name, self.specification.name) if name)

    @property
    def variables(self) -> tuple[Variable, ...]:
        """All variables of the joint distribution."""
        return self.specification.variables

    def __getitem__(self, term: Term) -> Form:
        """The identified form of a term, written as in the specification."""
        if term not in self._forms:
            raise QuestionError(f"{self} has no term {term}; it has {', '.join(map(str, self._forms))}")
        return self._forms[term]

    def ask(self, term: Term, *, soft: Variable | Iterable[Variable] = (), largest: int = LARGEST) -> Question:
        """The question P(Searched | Known), compiled; asked again it is the same question.

        Every variable that the term does not name is unknown, and summed out [E3.11]. Those of the known that are
        ``soft`` will be told a distribution instead of a value: the joint is weighed by it, and they are summed out
        (a likelihood; nothing of it stays in the question). Raises `QuestionError` for a
        variable that is not in the description, `TooLarge` when an array would pass ``largest`` bytes, and
        `Unidentified` when a free form that the question needs has met no data.
        """
        if not isinstance(term, Term):
            raise QuestionError(f"{self} is asked {term!r}, and wants a term: P(Searched | Known)")
        softly = (soft,) if isinstance(soft, Variable | str) else tuple(soft)
        key = (term, softly, largest)
        if key not in self._questions:
            self._questions[key] = Question(self, term, largest, soft=softly, like=self._plans.get(key))
        return self._questions[key]

    def learn(self, datum: Mapping[str, Any], *, weight: float = 1.0) -> Description:
        """The next description: this one with one more datum, a value for each variable by name.

        It is the description that all data together identify. What is kept of the data are sums (sufficient
        statistics), so time and memory do not depend on how many there were. Questions asked of this description
        keep their plan in the next one. Raises `DataError` or `NotAValue`.
        """
        if not 0 <= weight < inf:
            raise DataError(f"a datum that weighs {weight} cannot be learnt; a weight is a number of observations")
        return self._with(datum, weight)

    def forget(self, datum: Mapping[str, Any], *, weight: float = 1.0) -> Description:
        """The next description: this one without a datum that it learnt; the inverse of `learn`.

        Raises `DataError` when sums show that the datum was never learnt.
        """
        if not 0 <= weight < inf:
            raise DataError(f"a datum that weighs {weight} cannot be forgotten")
        return self._with(datum, -weight)

    def _with(self, datum: Mapping[str, Any], weight: float) -> Description:
        if not isinstance(datum, Mapping):
            raise DataError(f"a datum is a mapping from a variable's name to its value, and not {datum!r}")
        needed = [v for v in self.variables if any(v in t.variables for t, f in self._forms.items() if f.learns)]
        names = {key for v in needed for key in (v.name, v.keyword)}
        missing = [v for v in needed if v.name not in datum and v.keyword not in datum]
        if missing:
            raise DataError(f"the datum has no column for {text(missing)}")
        read = Samples.of([{name: value for name, value in datum.items() if name in names}], needed, [weight])
        forms = {term: form.learn(term, read) if form.learns else form for term, form in self._forms.items()}
        following = Description(self.specification, forms, self.name)
        following._factors = {t: factor for t, factor in self._factors.items() if forms[t] is self._forms[t]}
        # The plans alone are handed on: a question would hold its description, and that one the one before it.
        following._plans = self._plans | {key: question.plan for key, question in self._questions.items()}
        return following

    def relevant(self, term: Term) -> list[Factor]:
        """The factors that a question depends on: those that lead to a searched or known variable.

        All others sum to 1 over unknown variables.
        """
        wanted = self._wanted(term)
        return [self._factor(t) for t in self._forms if t in wanted]

    def beside(self, term: Term) -> tuple[str, ...]:
        """The names of all other terms than those of `relevant`."""
        wanted, own = self._wanted(term), self.specification.name
        free = self.specification.free
        return tuple(
            label(t.of, t.given, self.names if t in free else (own,) if own else ())
            for t in self._forms
            if t not in wanted
        )

    def _wanted(self, term: Term) -> dict[Term, None]:
        defining = {v: t for t in self._forms for v in t.of}
        wanted: dict[Term, None] = {}
        waiting = list(term.variables)
        while waiting:
            here = defining[waiting.pop()]
            if here not in wanted:
                wanted[here] = None
                waiting.extend(here.given)
        return wanted

    def _factor(self, term: Term) -> Factor:
        ready = self.specification._factors.get(term) or self._factors.get(term)
        if ready is None:
            ready = self._factors[term] = self._forms[term].factor(term, self.names)
        return ready

    def __str__(self) -> str:
        return text(self.names) or "a description without a name"

    def __repr__(self) -> str:
        return _drawn(f"Description {self}", self.variables, self._forms)


def _drawn(title: str, variables: Iterable[Variable], forms: Mapping[Term, Form]) -> str:
    """A decomposition as it is looked at: its variables with their values, its terms with their forms."""
    width = max(len(str(term)) for term in forms)
    lines = [title]
    lines += [f"  {variable} in {{{variable.domain}}}, {len(variable)} values" for variable in variables]
    lines += [f"  {term!s:{width}} = {form!r}" for term, form in forms.items()]
    return "\n".join(lines)


def _check(specification: Specification) -> None:
    """Refuse what is no decomposition [E3.9], naming what is wrong."""
    defining: dict[Variable, Term] = {}
    names: dict[str, Variable] = {}
    if not specification.forms:
        raise SpecificationError(f"{specification} has no terms")
    for term, form in specification.forms.items():
        if not isinstance(term, Term) or not isinstance(form, Form):  # type: ignore[redundant-expr]  # a user's slip
            raise SpecificationError(f"{specification} has {term}: {form!r}, and wants a term and its form")
        for variable in term.of:
            if variable in defining:
                raise SpecificationError(
                    f"{specification} is no decomposition: {variable} is left of the bar in both "
                    f"{defining[variable]} and {term}"
                )
            defining[variable] = term
        for variable in term.variables:
            if names.setdefault(variable.keyword, variable) != variable:
                raise SpecificationError(f"{specification} has two different variables named {variable}")
    for term in specification.forms:
        for variable in term.given:
            if variable not in defining:
                raise SpecificationError(
                    f"{specification} is no decomposition: {variable} in {term} is left of no bar; "
                    f"add P({variable})"
                )
    _check_order(specification, defining)


def _check_order(specification: Specification, defining: Mapping[Variable, Term]) -> None:
    """Each term may be given only what terms before it define, in some order of them."""
    waiting = {term: {defining[v] for v in term.given} for term in specification.forms}
    users: dict[Term, list[Term]] = {}
    for term, needs in waiting.items():
        for need in needs:
            users.setdefault(need, []).append(term)
    ready = [term for term, needs in waiting.items() if not needs]
    while ready:
        term = ready.pop()
        del waiting[term]
        for user in users.get(term, ()):
            waiting[user].discard(term)
            if not waiting[user]:
                ready.append(user)
    if waiting:
        # Follow the needs of any term that is left: what comes round again is a cycle.
        path = [next(iter(waiting))]
        while path[-1] not in path[:-1]:
            path.append(next(term for term in specification.forms if term in waiting[path[-1]]))
        cycle = path[path.index(path[-1]) :]
        raise SpecificationError(
            f"{specification} is no decomposition: {' needs '.join(map(str, cycle))}, which is a cycle"
        )
