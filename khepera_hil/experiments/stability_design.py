"""Which entries are made larger and which smaller in which night: the design of the experiment.

Every perturbation is run with its opposite (all signs the other way round) in the same night, with the same chance:
a *pair*. Half the difference of a pair is free of the night, of what all perturbations do alike, and of what two
entries do together, so that entries' own effects are left.

One entry at a time, each night would tell about one of them. With all entries at once, each by a sign that is
independent of the others' (a column of a Hadamard matrix), every night tells about every entry: for m entries the
same intervals from m times fewer nights.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from khepera_hil.errors import UsageError
from khepera_hil.experiments.cases import Case
from khepera_hil.experiments.stability_exact import matters
from khepera_hil.experiments.stability_tables import ENTRIES, Entry, chosen, movable, zeros

__all__ = ["BY", "Design", "entries_of", "signs_of"]

BY = ("all", "column", "entry")

_PAIRS = {"all": 10, "column": 1, "entry": 1}
_MARKS = {1: "+", -1: "-", 0: "0"}
_SIGNS = {mark: sign for sign, mark in _MARKS.items()}


@dataclass(frozen=True)
class Design:
    """What was asked for."""

    amount: float = 0.5
    """Odds are times, or divided by, 1 more than this."""
    opened: float = 0.0
    """The probability that zeros get when they are opened; 0: they stay."""
    by: str = "all"
    """What is perturbed together: ``all``, a ``column`` of a table, or one ``entry``."""
    only: tuple[str, ...] = ()
    """Tables, columns, entries by name; none: every entry that any answer depends on."""
    pairs: int | None = None
    """For each seed and for what is perturbed together (None: 10 of all, else 1)."""
    seconds: float = 360.0
    """That a night lasts."""

    def cases(self, seeds: Sequence[int]) -> list[Case]:
        """For each seed the published tables, then the pairs. Raises UsageError when nothing can be perturbed."""
        groups = self._groups()
        pairs = self.pairs or _PAIRS[self.by]
        found: list[Case] = []
        for seed in seeds:
            found.append(self.published(seed))
            for group in groups:
                rows = {_row((seed - 1) * pairs + k, group): None for k in range(pairs)}
                for row in rows:
                    signs = dict(zip(group, row, strict=True))
                    opposite = {entry: -sign for entry, sign in signs.items()}
                    found += [self._perturbed(seed, signs), self._perturbed(seed, opposite)]
        return found

    def published(self, seed: int) -> Case:
        """A night with the tables as printed."""
        return {"seed": seed, "seconds": self.seconds, "signs": ""}

    def entries(self) -> tuple[Entry, ...]:
        """What is perturbed."""
        some = set(chosen(self.only)) if self.only else set(ENTRIES)
        useful = matters()
        able = [entry for entry in movable() if useful[entry]] + (list(zeros()) if self.opened else [])
        found = tuple(entry for entry in ENTRIES if entry in some and entry in able)
        if not found:
            raise UsageError(
                "none of these entries can be perturbed: what is certain stays so, and no answer depends on what "
                "tables 3 to 7 say of fire-intervention"
                + ("" if self.opened else "; zeros are opened by --open-zeros only")
            )
        return found

    def _groups(self) -> list[tuple[Entry, ...]]:
        entries = self.entries()
        if self.by == "all":
            return [entries]
        if self.by == "entry":
            return [(entry,) for entry in entries]
        columns = dict.fromkeys((entry.table, entry.column) for entry in entries)
        return [tuple(e for e in entries if (e.table, e.column) == column) for column in columns]

    def _perturbed(self, seed: int, signs: Mapping[Entry, int]) -> Case:
        marks = "".join(_MARKS[signs.get(entry, 0)] for entry in ENTRIES)
        case: Case = {**self.published(seed), "signs": marks, "amount": self.amount}
        return {**case, "opened": self.opened} if self.opened else case


def signs_of(case: Case) -> dict[Entry, int]:
    """The entries that are perturbed in a case, and which way."""
    marks = str(case["signs"])
    return {entry: _SIGNS[mark] for entry, mark in zip(ENTRIES, marks, strict=False) if mark != "0"}


def entries_of(cases: Sequence[Case]) -> tuple[Entry, ...]:
    """All that are perturbed in any of the cases, in the tables' order."""
    found = {entry for case in cases for entry in signs_of(case)}
    return tuple(entry for entry in ENTRIES if entry in found)


def _row(number: int, group: Sequence[Entry]) -> tuple[int, ...]:
    """A sign for each of a group: a row of Sylvester's Hadamard matrix, without its first column, which is all +.

    Each of its columns is turned round or not by chance, once and for all: else there would be a row in which whole
    columns of the tables are raised together, which is no change.
    """
    order = 1 << len(group).bit_length()  # the least power of two above the group's size
    row = number % order
    signs = [-_TURNED[e] if (row & place).bit_count() % 2 else _TURNED[e] for place, e in enumerate(group, 1)]
    # A row and its opposite are the same pair.
    return tuple(sign * signs[0] for sign in signs)


_TURNED = dict(zip(ENTRIES, np.random.default_rng(96).choice([-1, 1], len(ENTRIES)).tolist(), strict=True))
