"""Data sets, as the places of the observed values."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brp.errors import DataError
from brp.variables import Variable

__all__ = ["Data", "Samples"]

Data = Mapping[str, Any] | Iterable[Mapping[str, Any]]
"""Columns (a mapping from a variable's name to all its values) or rows (a mapping for each datum)."""


class Samples:
    """Observed values: for each variable that was observed, the places of its values, shape ``(n,)``."""

    def __init__(self, places: Mapping[Variable, NDArray[np.intp]], count: int) -> None:
        self.places = dict(places)
        self.count = count

    @classmethod
    def of(cls, data: Data | None, variables: Iterable[Variable]) -> Samples:
        """Read columns or rows; other columns are left alone. Raises `DataError` or `NotAValue`."""
        columns = _columns(data)
        lengths = {name: len(column) for name, column in columns.items()}
        if len(set(lengths.values())) > 1:
            raise DataError(f"the columns of the data are of different lengths: {lengths}")
        places: dict[Variable, NDArray[np.intp]] = {}
        for variable in variables:
            column = columns.get(variable.name, columns.get(variable.keyword))
            if column is not None:
                places[variable] = np.fromiter((variable.place(value) for value in column), dtype=np.intp)
        return cls(places, next(iter(lengths.values()), 0))

    def __getitem__(self, variable: Variable) -> NDArray[np.intp]:
        """The places of one variable's values."""
        if variable not in self.places:
            if not self.count:
                return np.empty(0, dtype=np.intp)
            raise DataError(f"the data have no column for {variable}")
        return self.places[variable]

    def where(self, variable: Variable, values: Sequence[int]) -> Samples:
        """Those samples in which ``variable`` was at one of these places."""
        kept = np.isin(self[variable], values)
        return Samples({v: column[kept] for v, column in self.places.items()}, int(kept.sum()))


def _columns(data: Data | None) -> Mapping[str, Any]:
    if data is None:
        return {}
    if isinstance(data, Mapping):
        return data
    rows = list(data)
    names = dict.fromkeys(name for row in rows for name in row)
    for number, row in enumerate(rows):
        for name in names:
            if name not in row:
                raise DataError(f"datum {number} has no {name}")
    return {name: [row[name] for row in rows] for name in names}
