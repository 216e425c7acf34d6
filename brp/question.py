"""Questions: P(Searched | Known) of a description, simplified and compiled once, answered for each evidence."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from brp.distribution import Distribution
from brp.errors import EvidenceError, ImpossibleEvidence, QuestionError, SpecificationError, TooLarge
from brp.expression import Leaf, Node, Otherwise, Split, Subroutine, node, postorder
from brp.factors import Factor, label
from brp.forms import Form
from brp.formula import formula
from brp.hierarchy import hierarchy
from brp.logs import logarithms
from brp.plan import Sizes, compiled, probabilities
from brp.renewal import Plan, renewed
from brp.simplification import Simplified, simplify
from brp.variables import Term, Variable, text

if TYPE_CHECKING:
    from brp.description import Description

__all__ = ["LARGEST", "Question"]

LARGEST = 256_000_000
"""The bytes that the largest array of a question may have, unless told otherwise."""


class Question(Form):
    """P(Searched | Known): call it with the known values by keyword, and it answers a `Distribution`.

    It is also a form, the paper's Bayesian subroutine: a conditional distribution, normalised for every value of
    its known variables. `renamed` gives it other variables for that purpose.
    """

    def __init__(
        self,
        description: Description,
        term: Term,
        largest: int = LARGEST,
        *,
        rules: tuple[Form, ...] = (),
        like: Plan | None = None,
    ) -> None:
        variables = frozenset(description.variables)
        missing = [v for v in term.variables if v not in variables]
        if missing:
            raise QuestionError(
                f"{description} has no variable {text(missing)}; it has {text(description.variables)}"
            )
        self.description = description
        self.term = term
        self.largest = largest
        self.rules = rules
        self.searched, self.known = term.of, term.given
        self.names = description.names
        factors = tuple(description.relevant(term))
        kept = None if like is None else renewed(like, factors)
        self.simplified: Simplified = kept or simplify(factors, self.searched, self.known, self.name)
        self.plan = Plan(self.simplified, factors)
        if self.simplified.largest * 8 > largest:
            raise TooLarge(
                f"{self.name} needs an array of {self.simplified.largest * 8 / 1e6:.0f} MB, more than the "
                f"{largest / 1e6:.0f} MB allowed, and {self.simplified.operations:.2g} multiplications; know or "
                "search fewer variables together, or raise largest="
            )
        self.start: Node = self.simplified.start
        for rule in rules:
            self.start = Otherwise(
                self.searched, self.start, node(rule.factor(term, self.names), frozenset(self.known))
            )
        self._shape = tuple(map(len, self.searched))
        self._table: NDArray[np.float64] | None = None
        sizes = Sizes(self.start)
        matter = self.known
        if sizes.folds(self.start):
            # Every answer at once; a call then only looks it up, and keeps what it made of it. What does not matter
            # (a reading, once its cause is known) has no axis: the table would be as large as all that is known.
            matter = tuple(v for v in self.known if self.start.has(v))
            table = probabilities(self.start, (*matter, *self.searched))
            self._table = table.reshape(-1, *self._shape)
            self._answers: list[Distribution | None] = [None] * len(self._table)
            self.source = "# every answer is in a table"
        else:
            plan = compiled(self.start, self.known, self.searched, sizes)
            self._run, self.source = plan.run, plan.source
        strides, stride = [0] * len(self.known), 1
        for number in reversed(range(len(self.known))):
            if self.known[number] in matter:
                strides[number] = stride
                stride *= len(self.known[number]) if self._table is not None else 1
        self._steps = [
            (
                v.keyword,
                {value: place * stride for value, place in v.places.items()}
                if self._table is not None
                else v.places,
            )
            for v, stride in zip(self.known, strides, strict=True)
        ]

    @property
    def name(self) -> str:
        """``P(Vrot | Prox Dir delta-push pi-obstacle)``: as the paper writes it, in the order asked."""
        return label(self.searched, self.known, self.names)

    def __call__(self, **known: Any) -> Distribution:
        """The distribution over the searched variables, the known ones having these values.

        Raises `NotAValue` or `EvidenceError` for evidence that does not fit, `ImpossibleEvidence` when it has
        probability zero.
        """
        try:
            if self._table is not None:
                cell = 0
                for keyword, steps in self._steps:
                    cell += steps[known[keyword]]
            else:
                places = [steps[known[keyword]] for keyword, steps in self._steps]
        except (KeyError, TypeError):
            raise self._refusal(known) from None
        if len(self._steps) != len(known):
            raise self._refusal(known)
        if self._table is not None:
            return self._answers[cell] or self._answer(cell, known)
        p = self._run(places)
        return Distribution(self.searched, p.reshape(self._shape) if p is not None else self._slowly(known))

    def _answer(self, cell: int, known: Mapping[str, Any]) -> Distribution:
        assert self._table is not None
        p = self._table[cell]
        if np.isnan(p).any():
            p = self._slowly(known)
        answer = self._answers[cell] = Distribution(self.searched, p)
        return answer

    def _places(self, known: Mapping[str, Any]) -> dict[Variable, int]:
        return {variable: variable.place(known[variable.keyword]) for variable in self.known}

    def _slowly(self, known: Mapping[str, Any]) -> NDArray[np.float64]:
        """The answer in logarithms; raises `ImpossibleEvidence` when there is none."""
        places = self._places(known)
        logs = logarithms(self.start, self.searched, places)
        if np.isnan(logs).any():
            raise self._impossible(places)
        p: NDArray[np.float64] = np.exp(np.broadcast_to(logs, self._shape))
        total: float = p.sum()
        return p / total

    def _refusal(self, known: Mapping[str, Any]) -> EvidenceError:
        """What is wrong with the evidence, as a sentence."""
        wanted = {v.keyword: v for v in self.known}
        missing = [v for keyword, v in wanted.items() if keyword not in known]
        if missing:
            return EvidenceError(f"{self.name} must be told {text(missing)}")
        extra = [keyword for keyword in known if keyword not in wanted]
        if extra:
            return EvidenceError(
                f"{self.name} does not know {text(extra)}; it knows {text(self.known) or 'nothing'}"
            )
        try:
            self._places(known)
        except EvidenceError as error:
            return type(error)(f"{error}, in {self.name}")
        raise AssertionError("evidence was refused that fits")

    def _impossible(self, places: Mapping[Variable, int]) -> ImpossibleEvidence:
        """Name the fewest terms that exclude the evidence: leave out each without which it stays excluded."""
        (product,) = self.simplified.start.children
        leaves = [n for n in postorder(product) if isinstance(n, Leaf) and n.density.vanishes]
        innocent: frozenset[Any] = frozenset()
        for density in dict.fromkeys(leaf.density for leaf in leaves):
            logs = logarithms(product, self.searched, places, innocent | {density})
            if np.isnan(logs).any() or np.isneginf(logs).all():
                innocent |= {density}
        guilty = tuple(dict.fromkeys(str(leaf.density) for leaf in leaves if leaf.density not in innocent))
        said = ", ".join(f"{v} = {v.values[place]}" for v, place in places.items())
        together = "excludes it" if len(guilty) == 1 else "together exclude it"
        return ImpossibleEvidence(
            f"{said or 'nothing known'} is impossible in {self.name}: {' and '.join(guilty)} {together}", guilty
        )

    # As a form.

    def where_impossible(
        self, rule: Form | None = None, *, without: Variable | Iterable[Variable] = ()
    ) -> Question:
        """The same question, with an answer also where what is known has probability zero.

        ``without`` asks again without knowing these variables (pi-behavior without Behavior_t-1); ``rule`` is any
        form that fits the question's term: ``Uniform()``, a `Table`, another question. Each applies only where
        everything before it has no answer, and only for that combination of known values; where none has one,
        `ImpossibleEvidence` is raised, as it is without a rule.
        """
        dropped = (without,) if isinstance(without, Variable) else tuple(without)
        foreign = [v for v in dropped if v not in self.known]
        if foreign:
            raise QuestionError(f"{self.name} does not know {text(foreign)}, and cannot be asked without it")
        if (rule is None) == (not dropped):
            raise QuestionError(
                f"where {self.name} is impossible wants one rule: a form, or without= and a variable"
            )
        if rule is None:
            given = tuple(v for v in self.known if v not in dropped)
            rule = self.description.ask(Term(self.searched, given), largest=self.largest)
        return Question(self.description, self.term, self.largest, rules=(*self.rules, rule))

    def possible(self, **known: Any) -> bool:
        """Whether these known values have a probability above zero, so that no rule is needed to answer."""
        if known.keys() != {v.keyword for v in self.known}:
            raise self._refusal(known)
        try:
            places = self._places(known)
        except EvidenceError:
            raise self._refusal(known) from None
        return not np.isnan(logarithms(self.simplified.start, self.searched, places)).any()

    @property
    def inner(self) -> tuple[Form, ...]:
        """The forms of its description; a rule that asks the same description again adds none."""
        forms = [self.description[term] for term in self.description.specification.terms]
        others = [r for r in self.rules if not isinstance(r, Question) or r.description is not self.description]
        return (*forms, *others)

    def factor(self, term: Term, names: tuple[str, ...]) -> Factor:
        """The question as a factor of another description."""
        return _subroutine(self, {}, term)

    def renamed(self, new: Mapping[Variable, Variable]) -> Form:
        """The question as a form over other variables: ``{Theta1: Theta2}`` reads Theta2 where it knew Theta1."""
        return _Renamed(self, new)

    def __str__(self) -> str:
        written = formula(self.simplified)
        lines = [self.name] if written in (self.name, "1") else [self.name, f"= {written}"]
        lines += [
            f"where it is impossible: {rule.name if isinstance(rule, Question) else repr(rule)}"
            for rule in self.rules
        ]
        calls = hierarchy(self)
        if calls.levels > 1:
            lines += [self._partition(), str(calls)]
        return "\n".join(lines)

    def _partition(self) -> str:
        """All variables of the description, as searched, known and unknown."""
        unknown = [v for v in self.description.variables if v not in self.term.variables]
        parts = (("searched", self.searched), ("known", self.known), ("unknown", unknown))
        counted = ", ".join(f"{len(part)} {word}" for word, part in parts)
        hidden = f" ({text(unknown)})" if unknown else ""
        return f"{len(self.description.variables)} variables: {counted}{hidden}"

    def __repr__(self) -> str:
        return f"<Question {self.name}>"


class _Renamed(Form):
    """A question over other variables."""

    def __init__(self, question: Question, new: Mapping[Variable, Variable]) -> None:
        for old, variable in new.items():
            if old not in question.term.variables:
                raise SpecificationError(f"{question.name} has no {old} to be renamed")
            if old.values != variable.values:
                raise SpecificationError(f"{old} cannot be renamed {variable}: their values differ")
        self.question = question
        self.new = dict(new)

    @property
    def inner(self) -> tuple[Form, ...]:
        """The question."""
        return (self.question,)

    def factor(self, term: Term, names: tuple[str, ...]) -> Factor:
        """The question as a factor, its variables renamed."""
        return _subroutine(self.question, self.new, term)

    def __repr__(self) -> str:
        return f"{self.question!r} with {', '.join(f'{new} for {old}' for old, new in self.new.items())}"


def _subroutine(question: Question, new: Mapping[Variable, Variable], term: Term) -> Factor:
    searched = tuple(new.get(v, v) for v in question.searched)
    known = tuple(new.get(v, v) for v in question.known)
    if set(searched) != set(term.of):
        raise SpecificationError(
            f"{question.name} answers about {text(searched)}, and {term} wants {text(term.of)}"
        )
    foreign = [v for v in known if v not in term.given]
    if foreign:
        raise SpecificationError(
            f"{question.name} must know {text(foreign)}, which {term} does not give; renamed() can read another "
            "variable"
        )
    simplified = question.simplified
    # What the question sums out is its own: hidden from every variable of the same name around it.
    everything = {v for n in postorder(question.start) for v in _bound(n)}
    hidden = {v: v.hidden() for v in everything if v not in question.term.variables}
    opened = None if simplified.division or question.rules else simplified.kept
    plain = Subroutine(
        question.searched, question.known, question.names, question.start, opened, tuple(simplified.summed)
    )
    return plain.renamed({**hidden, **new})


def _bound(n: Node) -> Iterable[Variable]:
    """The variables that a node itself names."""
    if isinstance(n, Leaf):
        return n.density.scope
    if isinstance(n, Split):
        return (n.variable,)
    variables: tuple[Variable, ...] = getattr(n, "variables", ())
    return variables
