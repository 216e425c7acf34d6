"""The entries of tables 2 to 7, and the same tables with some of their entries made larger or smaller.

What is changed of an entry is its odds: it is multiplied, or divided, and its column made to sum to one again. So
columns stay distributions, whatever the amount; a zero stays a zero, and what is certain stays certain, unless
zeros are opened. All entries of a column by the same factor is no change at all.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cache
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from brp import Description, Table
from brp.derivative import numbers
from brp.programs.behavior import TABLES, behaving, specified
from khepera_hil.errors import UsageError

__all__ = [
    "ENTRIES",
    "PUBLISHED",
    "Entry",
    "Tables",
    "chosen",
    "described",
    "movable",
    "perturbed",
    "zeros",
]

Tables = Mapping[int, NDArray[np.float64]]
"""By the paper's number of the table: a row for each value of its variable, a column for each given Behavior."""


class Entry(NamedTuple):
    """One number in one of the tables."""

    table: int
    row: int
    column: int

    @property
    def value(self) -> str:
        """What the row is about, as a word: ``low``, ``recharge``, ``true``."""
        return _word(TABLES[self.table].of[0].values[self.row])

    @property
    def given(self) -> str:
        """The Behavior that the column is of; of table 2 it is the last one."""
        return _word(TABLES[self.table].given[0].values[self.column])

    @property
    def name(self) -> str:
        """As the command line has it: ``4:recharge:low``, table, column, row."""
        return f"{self.table}:{self.given}:{self.value}"

    def __str__(self) -> str:
        """As the paper writes it: ``P(recharge | patrol)``, ``P(Energy low | recharge)``."""
        what = self.value if self.table == 2 else f"{TABLES[self.table].of[0]} {self.value}"
        return f"P({what} | {self.given})"


def _word(value: object) -> str:
    return str(value).lower() if isinstance(value, bool) else str(value)


PUBLISHED: Tables = MappingProxyType({number: numbers(behaving, term) for number, term in TABLES.items()})
"""The paper's tables, each x being its equal share."""

ENTRIES: tuple[Entry, ...] = tuple(
    Entry(number, row, column)
    for number, p in PUBLISHED.items()
    for column in range(p.shape[1])
    for row in range(p.shape[0])
)
"""All 108, column by column."""


@cache
def movable() -> tuple[Entry, ...]:
    """Those that can be made larger or smaller: neither zero nor certain."""
    return tuple(entry for entry in ENTRIES if 0 < _at(PUBLISHED, entry) < 1)


@cache
def zeros() -> tuple[Entry, ...]:
    """Those that can be opened."""
    return tuple(entry for entry in ENTRIES if _at(PUBLISHED, entry) == 0)


def perturbed(signs: Mapping[Entry, int], amount: float, opened: float = 0.0) -> Tables:
    """The published tables with the odds of each entry times ``(1 + amount) ** sign``, sign being -1, 0 or 1.

    Zeros with the sign 1 get the probability ``opened`` each; the others of their column give it up in proportion.
    """
    tables = {number: p.copy() for number, p in PUBLISHED.items()}
    fresh = {number: np.zeros_like(p) for number, p in PUBLISHED.items()}
    for (number, row, column), sign in signs.items():
        tables[number][row, column] *= (1 + amount) ** sign
        if PUBLISHED[number][row, column] == 0 and sign > 0:
            fresh[number][row, column] = opened
    return {
        number: p / p.sum(axis=0) * (1 - fresh[number].sum(axis=0)) + fresh[number] for number, p in tables.items()
    }


def described(tables: Tables) -> Description:
    """pi-behavior with these tables."""
    return specified({number: Table(np.asarray(p)) for number, p in tables.items()}).identify()


def chosen(names: Sequence[str]) -> tuple[Entry, ...]:
    """The entries that these names mean: ``4`` a table, ``4:recharge`` a column, ``4:recharge:low`` an entry.

    Raises UsageError for what is none.
    """
    found: dict[Entry, None] = {}
    for name in names:
        parts = name.split(":")
        some = [entry for entry in ENTRIES if entry.name.split(":")[: len(parts)] == parts]
        if not some:
            raise UsageError(
                f"{name!r} is no part of tables 2 to 7: say a table (4), a column (4:recharge) or an entry "
                "(4:recharge:low); columns are behaviors, and rows the values that a table is about"
            )
        found.update(dict.fromkeys(some))
    return tuple(found)


def _at(tables: Tables, entry: Entry) -> float:
    return float(tables[entry.table][entry.row, entry.column])
