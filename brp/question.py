"""Questions: P(Searched | Known) of a description, simplified and compiled once, answered for each evidence."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from brp.batch import columns
from brp.distribution import Distribution
from brp.errors import EvidenceError, ImpossibleEvidence, QuestionError, TooLarge
from brp.evidence import Evidence, Signature
from brp.explain import Contribution, Explanation, bits
from brp.expression import Leaf, Node, Otherwise, node, postorder
from brp.factors import Density, Factor, label
from brp.forms import Form
from brp.formula import formula
from brp.hierarchy import hierarchy
from brp.logs import logarithms
from brp.plan import compiled, probabilities
from brp.propositions import Proposition
from brp.renewal import Plan, renewed
from brp.rows import Rows, unanswered
from brp.simplification import Simplified, simplify
from brp.subroutine import Renamed, subroutine
from brp.tables import Sizes
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
        soft: tuple[Variable, ...] = (),
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
        self.soft = soft
        self.searched, self.known = term.of, term.given
        self.names = description.names
        foreign = [v for v in soft if v not in self.known]
        if foreign:
            raise QuestionError(f"{text(foreign)} cannot be known softly in {self.name}, which does not know it")
        self.signature = Signature(self.name, self.known, soft)
        factors = tuple(description.relevant(term))
        kept = None if like is None else renewed(like, factors)
        if kept is None:
            made = simplify(factors, self.searched, self.known, self.name, soft)
            kept = replace(made, beside=description.beside(term))
        self.simplified: Simplified = kept
        self.plan = Plan(self.simplified, factors)
        if self.simplified.largest * 8 > largest:
            raise TooLarge(
                f"{self.name} needs an array of {_bytes(self.simplified.largest * 8)}, more than the "
                f"{_bytes(largest)} allowed, and {self.simplified.operations:.2g} multiplications; know or "
                "search fewer variables together, or raise largest="
            )
        self.start: Node = self.simplified.start
        for rule in rules:
            self.start = Otherwise(
                self.searched, self.start, node(rule.factor(term, self.names), frozenset(self.known))
            )
        self._shape = tuple(map(len, self.searched))
        self._table: NDArray[np.float64] | None = None
        self._rows: Rows | None = None
        self._hard = tuple(v for v in self.known if v not in soft) if soft else self.known
        sizes = Sizes(self.start)
        if sizes.folds(self.start):
            # Every answer at once; a call then only looks it up, and keeps what it made of it.
            matters = tuple(v for v in self.known if self.start.has(v))
            table = probabilities(self.start, (*matters, *self.searched))
            self._table = table.reshape(-1, *self._shape)
            gaps = np.logical_or.reduce(np.isnan(self._table.reshape(len(self._table), -1)), axis=1)
            self._gaps: list[bool] = list(gaps) if gaps.any() else []
            self._answers: list[Distribution | None] = [None] * len(self._table)
            self.source = "# every answer is in a table"
        else:
            plan = compiled(self.start, self._hard, self.searched, sizes, soft, keywords=True)
            self._run, self.source = plan.run, plan.source
        steps: list[tuple[str, Mapping[Any, int]]] = []
        self._strides: dict[Variable, int] = {}
        stride = 1
        for v in reversed(self._hard):
            if self._table is None:
                break  # the compiled function looks values up itself
            if self.start.has(v):
                steps.append((v.keyword, {value: place * stride for value, place in v.places.items()}))
                self._strides[v] = stride
                stride *= len(v)
            else:
                steps.append((v.keyword, dict.fromkeys(v.places, 0)))
        self._steps = steps[::-1]

    @property
    def name(self) -> str:
        """``P(Vrot | Prox Dir delta-push pi-obstacle)``: as the paper writes it, in the order asked."""
        if not self.soft:
            return label(self.searched, self.known, self.names)
        right = [f"(soft {v})" if v in self.soft else str(v) for v in self.known]
        return f"P({text(self.searched)} | {text([*right, *self.names])})"

    def __call__(self, /, *nameless: Any, **known: Any) -> Distribution:
        """The distribution over the searched variables, the known ones having these values.

        Raises `NotAValue` or `EvidenceError` for evidence that does not fit, `ImpossibleEvidence` when it has
        probability zero. A variable that is known softly is told a distribution, or a weight for each value.
        """
        if nameless:
            known_by = ", ".join(f"{v.keyword}=" for v in self.known) or "nothing"
            raise EvidenceError(f"{self.name} is told what is known by name ({known_by}), and not {nameless}")
        if self._table is None:
            try:
                p = self._run(known)
            except (KeyError, TypeError, EvidenceError) as error:
                raise self._refusal(known, error) from None
            if p is None:
                p = self._slowly(known)
            return Distribution(self.searched, p if p.shape == self._shape else p.reshape(self._shape))
        cell = 0
        try:
            for keyword, steps in self._steps:
                cell += steps[known[keyword]]
            if len(known) != len(self.known):
                raise KeyError
        except (KeyError, TypeError) as error:
            raise self._refusal(known, error) from None
        return self._answers[cell] or self._answer(cell, known)

    def _answer(self, cell: int, told: Mapping[str, Any]) -> Distribution:
        assert self._table is not None
        p = self._table[cell]
        if self._gaps and self._gaps[cell]:
            p = self._slowly(told)
        answer = self._answers[cell] = Distribution(self.searched, p)
        return answer

    def _slowly(self, told: Mapping[str, Any]) -> NDArray[np.float64]:
        """The answer in logarithms; raises `ImpossibleEvidence` when there is none."""
        evidence = self.signature.read(told)
        logs = self._logarithms(self.start, evidence)
        if np.isnan(logs).any():
            raise self._impossible(evidence)
        p: NDArray[np.float64] = np.exp(np.broadcast_to(logs, self._shape))
        total: float = p.sum()
        return p / total

    def _logarithms(
        self, start: Node, evidence: Evidence, without: frozenset[Density] = frozenset()
    ) -> NDArray[np.float64]:
        return logarithms(start, self.searched, evidence.places, without, evidence.logs)

    def _refusal(self, told: Mapping[str, Any], error: Exception) -> Exception:
        """What is wrong with the evidence, as a sentence; the error itself where it came from a form's function."""
        try:
            self.signature.read(told)
        except EvidenceError as wrong:
            return wrong
        return error

    def _impossible(self, evidence: Evidence) -> ImpossibleEvidence:
        """Name the fewest terms that exclude the evidence: leave out each without which it stays excluded."""
        (product,) = self.simplified.start.children
        leaves = [n for n in postorder(product) if isinstance(n, Leaf) and n.density.vanishes]
        innocent: frozenset[Any] = frozenset()
        for density in dict.fromkeys(leaf.density for leaf in leaves):
            logs = self._logarithms(product, evidence, innocent | {density})
            if np.isnan(logs).any() or np.isneginf(logs).all():
                innocent |= {density}
        guilty = tuple(dict.fromkeys(str(leaf.density) for leaf in leaves if leaf.density not in innocent))
        together = "excludes it" if len(guilty) == 1 else "together exclude it"
        return ImpossibleEvidence(
            f"{evidence} is impossible in {self.name}: {' and '.join(guilty)} {together}", guilty
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
        dropped = (without,) if isinstance(without, Variable | str) else tuple(without)
        foreign = [v for v in dropped if v not in self.known]
        if foreign:
            raise QuestionError(f"{self.name} does not know {text(foreign)}, and cannot be asked without it")
        if (rule is None) == (not dropped):
            raise QuestionError(
                f"where {self.name} is impossible wants one rule: a form, or without= and a variable"
            )
        if self.soft:
            raise QuestionError(f"{self.name} knows {text(self.soft)} only softly, and has no rows to fill")
        if rule is not None and not isinstance(rule, Form):
            raise QuestionError(f"where {self.name} is impossible wants a form, and not {rule!r}")
        if rule is None:
            given = tuple(v for v in self.known if v not in dropped)
            rule = self.description.ask(Term(self.searched, given), largest=self.largest)
        return Question(self.description, self.term, self.largest, rules=(*self.rules, rule))

    def batch(self, rows: Mapping[str, Any]) -> NDArray[np.float64]:
        """The answers to many rows of evidence at once: ``turn.batch({"Dir": dirs, "Prox": proxes})``.

        ``rows`` has a column of values for each known variable, all of one length n (for what is known softly, n
        times what a call would be told). The answer has the shape ``(n, ...)``, an axis for each searched variable
        after the first; row by row it is what a call answers. Raises as a call does, naming the row.
        """
        count, evidence = columns(self.signature, rows)
        if self._table is not None:
            cell = np.zeros(count, dtype=np.intp)
            for v, stride in self._strides.items():
                cell += evidence.places[v] * stride
            answers = self._table[cell]
        else:
            if self._rows is None:
                self._rows = Rows(self.start, self._hard, self.searched, self.soft, self.simplified.largest)
            answers = self._rows.answer(count, evidence)
        wrong = np.flatnonzero(unanswered(answers))
        if len(wrong):
            row = int(wrong[0])
            try:
                self(**{keyword: column[row] for keyword, column in rows.items()})
            except ImpossibleEvidence as error:
                raise ImpossibleEvidence(f"row {row}: {error}", error.terms) from None
        return answers

    def probability(self, proposition: Proposition, given: Proposition | None = None, /, **known: Any) -> float:
        """The probability of a proposition about what is searched: ``turn.probability(Vrot > 0, Dir=3, Prox=12)``.

        ``given`` is another proposition to be taken as true as well.
        """
        return self(**known).probability(proposition, given)

    def explain(self, value: Any, /, **known: Any) -> Explanation:
        """What each term says for or against a value, the known ones being these: see `Contribution`."""
        p = self(**known)
        here, evidence = p[value], self.signature.read(known)
        at = dict(zip(self.searched, p.place(value), strict=True)) | dict(evidence.places)
        leaves = [n for n in postorder(self.start) if isinstance(n, Leaf)]
        contributions = []
        for density in dict.fromkeys(leaf.density for leaf in leaves):
            logs = np.broadcast_to(self._logarithms(self.start, evidence, frozenset((density,))), self._shape)
            # Without the term nothing need be left that tells the values apart, or that excludes any.
            without = float(np.exp(logs[tuple(at[v] for v in self.searched)]))
            own = None
            if all(v in at for v in density.scope):
                own = float(np.exp(density.log(*(at[v] for v in density.scope))))
            contributions.append(Contribution(str(density), without, bits(here, without), own))
        contributions.sort(key=lambda c: -abs(c.bits))
        return Explanation(self.name, value, here, tuple(contributions))

    def possible(self, /, **known: Any) -> bool:
        """Whether these known values have a probability above zero, so that no rule is needed to answer."""
        return not np.isnan(self._logarithms(self.simplified.start, self.signature.read(known))).any()

    @property
    def inner(self) -> tuple[Form, ...]:
        """The forms of its description; a rule that asks the same description again adds none."""
        forms = [self.description[term] for term in self.description.specification.terms]
        others = [r for r in self.rules if not isinstance(r, Question) or r.description is not self.description]
        return (*forms, *others)

    def factor(self, term: Term, names: tuple[str, ...]) -> Factor:
        """The question as a factor of another description."""
        return subroutine(self, {}, term)

    def renamed(self, new: Mapping[Variable, Variable]) -> Form:
        """The question as a form over other variables: ``{Theta1: Theta2}`` reads Theta2 where it knew Theta1."""
        return Renamed(self, new)

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


def _bytes(count: int) -> str:
    return f"{count / 1e6:.0f} MB" if count >= 1_000_000 else f"{count} bytes"
