"""Derivatives of a question's answers with respect to the numbers in its description's tables.

An answer is a ratio of two sums of products of table entries, and in each product a table stands once. So the joint
probability of what is searched and known is linear in every column of every table, and

    d P(Searched Known) / d e = P(Searched Known, the column being certain of the value) - P(Searched Known)

is exact where e moves the column c towards the value v: from p to (1 - e) p + e (certain v). The description with a
column that is certain is a description like any other, so the engine answers both sides; nothing is approximated,
and no step has to be chosen. The answer's own derivative follows by the rule for quotients.

What moves one entry and keeps its column a distribution is a choice. `towards` is the one above: it also tells what
opening a zero would do. `by_odds` multiplies the entry's odds by 1 + s, all others keeping their proportions, which
moves the column from p by s p_v (certain v - p): a zero stays a zero, and what is certain stays certain.
"""

from __future__ import annotations

from math import prod

import numpy as np
from numpy.typing import NDArray

from brp.description import Description, Specification
from brp.errors import QuestionError, TooLarge
from brp.forms import Form, Table, Uniform
from brp.variables import Term

__all__ = ["LARGEST", "by_odds", "numbers", "towards"]

LARGEST = 256_000_000
"""The bytes that a question's derivatives may have."""

Array = NDArray[np.float64]


def towards(description: Description, question: Term, table: Term) -> Array:
    """The derivative of ``question``'s answers as each entry's column of ``table`` moves towards that entry.

    ``question`` is P(Searched | Known), asked without rules; ``table`` is a term of the description. The shape is
    that of the table (left of the bar first), then the searched, then the known variables' sizes; nan where what is
    known is impossible. Raises `QuestionError` for terms that the description lacks, and `TooLarge`.
    """
    if table not in description.specification.terms:
        raise QuestionError(f"{description} has no term {table}, so no answer can depend on it")
    sizes = [len(v) for v in (*table.variables, *question.variables)]
    if 8 * prod(sizes) > LARGEST:
        raise TooLarge(f"the derivatives of {question} by {table} are {prod(sizes)} numbers: know fewer variables")
    searched = tuple(range(len(question.of)))
    joint = Term(question.of + question.given)
    here = description.ask(joint)().p
    mass = here.sum(axis=searched)
    with np.errstate(invalid="ignore", divide="ignore"):
        answer = here / mass
    p = numbers(description, table)
    made = np.empty(sizes)
    for at in np.ndindex(*p.shape):
        column = (slice(None),) * len(table.of) + at[len(table.of) :]
        certain = p.copy()
        certain[column] = 0
        certain[at] = 1
        there = _retabled(description, table, Table(certain)).ask(joint)().p
        slope = there - here
        with np.errstate(invalid="ignore", divide="ignore"):
            made[at] = (slope - answer * slope.sum(axis=searched)) / mass
    return made


def by_odds(description: Description, question: Term, table: Term) -> Array:
    """The derivative as each entry's odds grow, per unit of their logarithm; shape and errors as of `towards`."""
    p = numbers(description, table)
    slopes: Array = p.reshape(p.shape + (1,) * len(question.variables)) * towards(description, question, table)
    return slopes


def numbers(description: Description, table: Term) -> Array:
    """The probabilities of a term, whatever its form: an axis for each variable, left of the bar first."""
    forms: dict[Term, Form] = {table: description[table]}
    if table.given:
        forms = {Term(table.given): Uniform(), **forms}
    alone = Specification(forms).identify().ask(Term(table.variables))().p
    p: Array = alone / alone.sum(axis=tuple(range(len(table.of))))
    return p


def _retabled(description: Description, table: Term, form: Table) -> Description:
    """The description with another table in the place of one."""
    forms = {term: description[term] for term in description.specification.terms}
    return Specification(forms | {table: form}, name=description.specification.name).identify(name=description.name)
