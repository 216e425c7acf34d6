"""Data sets, as the places of the observed values."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from math import prod
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from brp.errors import DataError, SpecificationError
from brp.variables import Term, Variable, cells

__all__ = ["Data", "Samples", "empty", "weighed"]

LARGEST = 32_000_000
"""The most numbers that are kept for one term."""

Data = Mapping[str, Any] | Iterable[Mapping[str, Any]]
"""Columns (a mapping from a variable's name to all its values) or rows (a mapping for each datum)."""


class Samples:
    """Observed values: for each variable that was observed, the places of its values, shape ``(n,)``.

    ``weights``, shape ``(n,)``, say how many observations each sample counts as; a negative one removes.
    """

    def __init__(
        self,
        places: Mapping[Variable, NDArray[np.intp]],
        count: int,
        weights: NDArray[np.float64] | None = None,
    ) -> None:
        self.places = dict(places)
        self.count = count
        self.weights: NDArray[np.float64] = np.ones(count) if weights is None else weights

    @classmethod
    def of(cls, data: Data | None, variables: Iterable[Variable], weights: ArrayLike | None = None) -> Samples:
        """Read columns or rows; other columns are left alone. Raises `DataError` or `NotAValue`."""
        columns = _columns(data)
        for name, column in columns.items():
            if isinstance(column, str) or not hasattr(column, "__len__"):
                raise DataError(f"the data have {column!r} for {name}, and not a column of values")
        lengths = {name: len(column) for name, column in columns.items()}
        if len(set(lengths.values())) > 1:
            raise DataError(f"the columns of the data are of different lengths: {lengths}")
        places: dict[Variable, NDArray[np.intp]] = {}
        for variable in variables:
            column = columns.get(variable.name, columns.get(variable.keyword))
            if column is not None:
                places[variable] = np.fromiter((variable.place(value) for value in column), dtype=np.intp)
        count = next(iter(lengths.values()), 0)
        return cls(places, count, None if weights is None else _weights(weights, count))

    def __getitem__(self, variable: Variable) -> NDArray[np.intp]:
        """The places of one variable's values."""
        if variable not in self.places:
            if not self.count:
                return np.empty(0, dtype=np.intp)
            raise DataError(f"the data have no column for {variable}")
        return self.places[variable]

    def cells(self, variables: Iterable[Variable]) -> NDArray[np.intp]:
        """The place of each sample among the cells of some variables, shape ``(n,)``."""
        at = np.zeros(self.count, dtype=np.intp)
        for variable in variables:
            at = at * len(variable) + self[variable]
        return at

    def where(self, variable: Variable, values: Sequence[int]) -> Samples:
        """Those samples in which ``variable`` was at one of these places."""
        kept = np.isin(self[variable], values)
        return Samples({v: column[kept] for v, column in self.places.items()}, int(kept.sum()), self.weights[kept])


def empty(term: Term, *first: int) -> NDArray[np.float64]:
    """Sums of no samples yet: zeros, an axis for each given variable behind those of the lengths ``first``."""
    numbers = prod(first) * cells(term.given)
    if numbers > LARGEST:
        raise SpecificationError(
            f"{term} would keep {numbers} numbers, more than {LARGEST}: give it fewer variables, or fewer values"
        )
    return np.zeros((*first, *map(len, term.given)))


def weighed(
    sums: NDArray[np.float64], at: NDArray[np.intp], weights: NDArray[np.float64], term: Term
) -> NDArray[np.float64]:
    """A copy of ``sums``, the weights added at these places of the flattened array; none may fall below zero."""
    made = sums.copy()
    flat = made.reshape(-1)
    np.add.at(flat, at, weights)
    if (weights < 0).any():
        touched = flat[at]
        if (touched < -1e-9).any():
            raise DataError(f"{term} cannot forget a datum that it never learnt, or more of it than it learnt")
        flat[at] = np.where(touched < 1e-9, 0.0, touched)  # fractions of weights leave crumbs
    return made


def _weights(weights: ArrayLike, count: int) -> NDArray[np.float64]:
    array = np.asarray(weights, dtype=np.float64)
    if array.shape != (count,):
        raise DataError(f"the weights have the shape {array.shape}, and {count} samples want ({count},)")
    if not np.isfinite(array).all():
        raise DataError("a weight is no finite number")
    return array


def _columns(data: Data | None) -> Mapping[str, Any]:
    if data is None:
        return {}
    if isinstance(data, Mapping):
        return data
    given: Any = data  # what a user may hand over, whatever the type says
    if isinstance(given, str) or not isinstance(given, Iterable):
        raise DataError(f"data are columns by name, or rows of values by name, and not {data!r}")
    rows = list(data)
    for number, row in enumerate(rows):
        if not isinstance(row, Mapping):
            raise DataError(f"datum {number} is {row!r}, and not a mapping from a variable's name to its value")
    names = dict.fromkeys(name for row in rows for name in row)
    for number, row in enumerate(rows):
        for name in names:
            if name not in row:
                raise DataError(f"datum {number} has no {name}")
    return {name: [row[name] for row in rows] for name in names}
