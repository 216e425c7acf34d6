"""Functions of variables: their parameters are the variables' names, so an axis is never a matter of position."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterator
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brp.errors import SpecificationError
from brp.variables import Variable, cells, text

__all__ = ["Function", "tabulate"]

CALLS = 5_000_000
"""A function is called for no more combinations of values than this, which takes seconds."""


class Function:
    """A Python function of some of ``variables``, called by name: ``lambda Dir, Prox: ...``.

    ``used`` are the variables that it names, in their own order; a parameter with a default that is no variable is
    left alone. ``what`` names it in a refusal.
    """

    def __init__(self, function: Callable[..., Any], variables: tuple[Variable, ...], what: str) -> None:
        self.function = function
        self.what = what
        known = {variable.keyword: variable for variable in variables}
        wanted: set[Variable] = set()
        for name, parameter in inspect.signature(function).parameters.items():
            if name in known:
                wanted.add(known[name])
            elif parameter.default is inspect.Parameter.empty:
                raise SpecificationError(
                    f"{what} is a function of {name!r}; it may use {text(variables) or 'nothing'}"
                )
        self.used = tuple(variable for variable in variables if variable in wanted)
        if cells(self.used) > CALLS:
            raise SpecificationError(
                f"{what} would be called for the {cells(self.used)} combinations of {text(self.used)}, more than "
                f"{CALLS}; let it use fewer of them, or write an array"
            )

    def rows(self) -> Iterator[Any]:
        """What it returns for every combination of values, the last variable running fastest."""
        names = [variable.keyword for variable in self.used]
        for values in product(*(variable.values for variable in self.used)):
            try:
                yield self.function(**dict(zip(names, values, strict=True)))
            except Exception as error:
                said = ", ".join(f"{v} = {value}" for v, value in zip(self.used, values, strict=True))
                error.add_note(f"in {self.what}, for {said}")
                raise


def tabulate(
    function: Callable[..., float] | float, variables: tuple[Variable, ...], what: str
) -> tuple[tuple[Variable, ...], NDArray[np.float64]]:
    """A function, or a constant, as the variables that it uses and an array with an axis for each of them."""
    if not callable(function):
        return (), np.asarray(_number(function, what))
    tabulated = Function(function, variables, what)
    numbers = np.fromiter((_number(row, what) for row in tabulated.rows()), dtype=np.float64)
    return tabulated.used, numbers.reshape(tuple(map(len, tabulated.used)))


def _number(said: Any, what: str) -> float:
    try:
        return float(said)
    except (TypeError, ValueError):
        raise SpecificationError(f"{what} is {said!r}, which is no number") from None
