"""Many rows of evidence answered in one vectorised call, to the same values as asked one by one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brp.errors import EvidenceError, NotAValue
from brp.evidence import Evidence, Signature, weigh
from brp.expression import Node
from brp.logs import logarithms
from brp.variables import Variable

__all__ = ["answered", "columns"]

NUMBERS = 30_000
"""So many numbers of an array are worked on at a time: as many as stay in a processor's cache."""

WORDS = 32
"""The words of so few values are compared with a whole column, one after the other."""


def columns(signature: Signature, told: Mapping[str, Any]) -> tuple[int, Evidence]:
    """How many rows there are, and their places (shape ``(n,)``) and weights (shape ``(n, values)``).

    Raises `EvidenceError` or `NotAValue`.
    """
    if not isinstance(told, Mapping):
        raise EvidenceError(f"a batch is told columns by name, as in {{'X': [1, 2]}}, and not {told!r}")
    named = {v.keyword: v for v in signature.known}
    if named.keys() != told.keys():
        signature.read(told)  # says which is missing, or superfluous
    for keyword, column in told.items():
        if isinstance(column, str) or not hasattr(column, "__len__"):
            raise EvidenceError(f"{keyword} in a batch was told {column!r}, and wants a column of values")
    lengths = {keyword: len(column) for keyword, column in told.items()}
    if len(set(lengths.values())) > 1:
        raise EvidenceError(f"the columns of a batch are of different lengths: {lengths}")
    if not lengths:
        raise EvidenceError(f"{signature.name} knows nothing, so that it has one answer and no batch of them")
    places: dict[Variable, Any] = {}
    weights: dict[Variable, Any] = {}
    for keyword, column in told.items():
        variable = named[keyword]
        if variable in signature.soft:
            weights[variable] = _weights(variable, column)
        else:
            places[variable] = _places(variable, column)
    return next(iter(lengths.values())), Evidence(places, weights)


def _places(variable: Variable, column: Sequence[Any]) -> NDArray[np.intp]:
    values = variable.values
    if isinstance(column, list | tuple) and not isinstance(values, range):
        return _looked_up(variable, column)
    given = np.asarray(column)
    if isinstance(values, range) and np.issubdtype(given.dtype, np.integer):
        places, rest = np.divmod(given.astype(np.int64) - values.start, values.step)
        wrong = np.flatnonzero((rest != 0) | (places < 0) | (places >= len(values)))
        if len(wrong):
            row = int(wrong[0])
            raise NotAValue(f"row {row}: {variable} = {given[row]} is not one of its values ({variable.domain})")
        return places.astype(np.intp)
    if given.dtype == np.bool_ and False in variable.places and True in variable.places:
        return np.where(given, variable.places[True], variable.places[False])
    if given.dtype.kind == "U" and len(values) <= WORDS and all(isinstance(value, str) for value in values):
        places = np.full(len(given), -1, dtype=np.intp)
        for place, word in enumerate(values):
            places[given == word] = place
        if (places >= 0).all():
            return places
    return _looked_up(variable, given.tolist())


def _looked_up(variable: Variable, listed: Sequence[Any]) -> NDArray[np.intp]:
    try:
        return np.fromiter(map(variable.places.__getitem__, listed), dtype=np.intp, count=len(listed))
    except (KeyError, TypeError):
        return np.fromiter(map(variable.place, listed), dtype=np.intp, count=len(listed))  # says which is none


def _weights(variable: Variable, column: Any) -> NDArray[np.float64]:
    """The weights of all rows; those that are plainly in order are taken together."""
    if (
        isinstance(column, np.ndarray)
        and column.dtype == np.float64
        and column.shape == (len(column), len(variable))
    ):
        totals = column.sum(axis=1)
        if (column >= 0).all() and (totals > 1e-9).all() and (totals < 1e9).all():
            return column
    each = [weigh(variable, said) for said in column]
    return np.stack(each) if each else np.empty((0, len(variable)))


def answered(
    start: Node, searched: tuple[Variable, ...], count: int, evidence: Evidence, largest: int
) -> NDArray[np.float64]:
    """The answers of all rows, shape ``(count, ...)``; nan in the rows that are impossible."""
    shape = tuple(map(len, searched))
    answers = np.empty((count, *shape))
    step = max(1, NUMBERS // largest)
    for first in range(0, count, step):
        part = slice(first, min(first + step, count))
        places = {v: column[part] for v, column in evidence.places.items()}  # type: ignore[index]  # columns here
        with np.errstate(divide="ignore"):
            soft = {v: np.log(column[part]) for v, column in evidence.weights.items()}
        rows = Variable("row", range(part.stop - part.start))
        logs = logarithms(start, (rows, *searched), places, soft=soft, rows=rows)
        answers[part] = np.exp(logs)
    totals = answers.reshape(count, -1).sum(axis=1)
    answers /= totals.reshape(-1, *(1 for _ in shape))
    return answers
