"""Why a value was drawn: which terms spoke for it and which against, down the hierarchy of descriptions.

At the top stands the question that was drawn from. Under it stand the variables that it did not know (the command
variable H of home): how probable each of their values was, and how probable it is now that the draw is known, which
says who is answerable for it. Then the questions that it calls, explained for the same draw; a variable that is not
known there is taken to have the value that is now the most probable.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from brp import BrpError, Distribution, Form, Question, Switch, Term, Value, Variable
from brp.explain import Explanation
from brp.subroutine import Renamed

__all__ = ["Belief", "Reason", "reasons"]

FEW = 64
"""Values of an unknown variable up to which it is worth telling."""

SLIGHT = 0.05
"""A case of a Switch that is less probable than this, after the draw, is not gone into."""


@dataclass(frozen=True)
class Belief:
    """A variable that the question did not know: before the draw was known, and after."""

    variable: str
    before: tuple[tuple[Value, float], ...]
    after: tuple[tuple[Value, float], ...]
    """Value and probability, in the variable's order."""


@dataclass(frozen=True)
class Reason:
    """One question's part in a draw."""

    depth: int
    """0 for the question that was drawn from, 1 for those that it calls, ..."""
    question: str
    under: str
    """What it holds under, such as ``H = avoidance (0.93)``; empty where it holds anyway."""
    known: tuple[tuple[str, Value], ...]
    explanation: Explanation | None
    """None where what was drawn is none of its values' business: then ``answer`` says what it answered."""
    answer: tuple[tuple[Value, float], ...]
    """The most probable values first."""
    beliefs: tuple[Belief, ...]


def reasons(question: Question, drawn: Mapping[str, Value], evidence: Mapping[str, Value]) -> Iterator[Reason]:
    """Go down from ``question``; ``drawn`` and ``evidence`` by the variables' names.

    Raises brp's errors when the evidence is refused.
    """
    yield from _explained(question, {**evidence, **drawn}, 0, "", set())


def _explained(
    question: Question, values: Mapping[str, Value], depth: int, under: str, told: set[Question]
) -> Iterator[Reason]:
    told.add(question)
    known = {v.keyword: values[v.name] for v in question.known}
    answer = question(**known)
    explanation = None
    if all(v.name in values for v in question.searched):
        wanted = tuple(values[v.name] for v in question.searched)
        explanation = question.explain(wanted[0] if len(wanted) == 1 else wanted, **known)
    beliefs, after = _hidden(question, values)
    yield Reason(
        depth,
        question.name,
        under,
        tuple((v.name, values[v.name]) for v in question.known),
        explanation,
        _best(answer),
        beliefs,
    )
    # What is known or drawn stays; the rest is taken as it is most probable now.
    guessed = {name: max(shares, key=lambda share: share[1])[0] for name, shares in after.items()}
    here = {**guessed, **values}
    for term in _relevant(question):
        yield from _form(question.description[term], here, after, depth + 1, "", told)


def _relevant(question: Question) -> list[Term]:
    """The terms that lead to what is searched or known; all others sum to 1."""
    terms = question.description.specification.terms
    defining = {variable: term for term in terms for variable in term.of}
    wanted: set[Term] = set()
    waiting = list(question.term.variables)
    while waiting:
        term = defining[waiting.pop()]
        if term not in wanted:
            wanted.add(term)
            waiting.extend(term.given)
    return [term for term in terms if term in wanted]


def _form(
    form: Form,
    values: Mapping[str, Value],
    after: Mapping[str, tuple[tuple[Value, float], ...]],
    depth: int,
    under: str,
    told: set[Question],
) -> Iterator[Reason]:
    if isinstance(form, Switch):
        name = form.variable.name
        shares = dict(after[name]) if name in after else {values[name]: 1.0} if name in values else {}
        for key, case in form.cases.items():
            those = key if isinstance(key, tuple) else (key,)
            share = sum(shares.get(value, 0.0) for value in those)
            if share >= SLIGHT:
                chosen = max(those, key=lambda value: shares.get(value, 0.0))
                where = f"{name} = {'|'.join(map(str, those))}" + (f" ({share:.2g})" if share < 1 else "")
                both = f"{under}, {where}" if under else where
                yield from _form(case, {**values, name: chosen}, after, depth, both, told)
    elif isinstance(form, Renamed):
        old = {old.name: values[new.name] for old, new in form.new.items() if new.name in values}
        yield from _form(form.question, {**values, **old}, after, depth, under, told)
    elif isinstance(form, Question):
        if form not in told and all(v.name in values for v in form.known):
            try:
                yield from _explained(form, values, depth, under, told)
            except BrpError:
                return  # what was taken to be so is impossible there: nothing to tell
    else:
        for inner in form.inner:
            yield from _form(inner, values, after, depth, under, told)


def _hidden(
    question: Question, values: Mapping[str, Value]
) -> tuple[tuple[Belief, ...], dict[str, tuple[tuple[Value, float], ...]]]:
    """The variables that the question sums out: before, and after what was drawn is known."""
    if question.soft:
        return (), {}
    searched = [v for v in question.searched if v.name in values]
    beliefs, after = [], {}
    for variable in question.simplified.summed:
        if len(variable) > FEW or variable.name in values or variable not in question.description.variables:
            continue
        try:
            now = _asked(question, variable, (*question.known, *searched), values)
            then = _asked(question, variable, question.known, values)
        except BrpError:
            continue  # too large, or impossible without the rule that answered
        beliefs.append(Belief(variable.name, _shares(then), _shares(now)))
        after[variable.name] = _shares(now)
    return tuple(beliefs), after


def _asked(
    question: Question, variable: Variable, given: tuple[Variable, ...], values: Mapping[str, Value]
) -> Distribution:
    asked = question.description.ask(Term((variable,), given), largest=question.largest)
    return asked(**{v.keyword: values[v.name] for v in given})


def _shares(answer: Distribution) -> tuple[tuple[Value, float], ...]:
    return tuple(zip(answer.variables[0].values, map(float, answer.p), strict=True))


def _best(answer: Distribution, few: int = 3) -> tuple[tuple[Value, float], ...]:
    pairs = zip(answer.values, map(float, answer.p.ravel()), strict=True)
    return tuple(sorted(pairs, key=lambda pair: -pair[1])[:few])
