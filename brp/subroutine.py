"""The Bayesian subroutine: a question as a form of another description, over renamed variables if need be."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING

from brp.errors import SpecificationError
from brp.expression import Leaf, Node, Split, Subroutine, postorder
from brp.factors import Factor
from brp.forms import Form
from brp.variables import Term, Variable, text

if TYPE_CHECKING:
    from brp.question import Question

__all__ = ["Renamed", "subroutine"]


class Renamed(Form):
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
        return subroutine(self.question, self.new, term)

    def __repr__(self) -> str:
        return f"{self.question!r} with {', '.join(f'{new} for {old}' for old, new in self.new.items())}"


def subroutine(question: Question, new: Mapping[Variable, Variable], term: Term) -> Factor:
    """The question as a factor of the description that ``term`` belongs to."""
    searched = tuple(new.get(v, v) for v in question.searched)
    known = tuple(new.get(v, v) for v in question.known)
    if question.soft:
        raise SpecificationError(
            f"{question.name} knows {text(question.soft)} only softly, and is no conditional distribution "
            f"that could stand for {term}"
        )
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
    opened = None if simplified.division or question.rules else simplified.kept
    everything = {v for n in postorder(question.start) for v in _bound(n)}
    # The factors may speak of more than the expression that they were simplified to.
    everything.update(v for factor in opened or () for v in factor.scope)
    hidden = {v: v.hidden() for v in everything if v not in question.term.variables}
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
