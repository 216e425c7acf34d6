"""What a pair of nights says about each entry: effects with their intervals."""

from __future__ import annotations

import math
from collections import Counter, defaultdict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from khepera_hil.experiments.cases import Case, Result
from khepera_hil.experiments.stability_design import entries_of, signs_of
from khepera_hil.experiments.stability_exact import Met, Situation, otherwise
from khepera_hil.experiments.stability_tables import ENTRIES, Entry, movable
from khepera_hil.experiments.tabled_night import met

__all__ = ["OUTCOMES", "RARELY", "Effect", "Nights", "Outcome"]

Array = NDArray[np.float64]

RARELY = 0.05
"""Decisions of a night: an entry by which fewer come out otherwise leaves 19 nights of 20 as they are."""

_LEVEL = 0.05
_RANK = 1e-9
"""What is so small beside the greatest eigenvalue is rounding: columns whose signs sum to zero have some."""
_NOTHING = 1e-9
"""An effect in an outcome's own units, or its error, of which rounding is all."""
_SPARE = 6
"""Pairs that there must be beyond the effects that are fitted."""


@dataclass(frozen=True)
class Outcome:
    """Something that a night comes to; ``value`` takes its result and the fires that were lit in a mean night."""

    title: str
    short: str
    value: Callable[[Result, float], float]
    digits: int = 2


OUTCOMES: Mapping[str, Outcome] = MappingProxyType(
    {
        "changes": Outcome(
            "changes of Behavior a minute",
            "changes/min",
            lambda r, lit: 600 * sum(r["changes"].values()) / max(1, sum(r["behaviors"].values())),
        ),
        "put_out": Outcome(
            "fires put out, of those lit, %", "put out %", lambda r, lit: 100 * r["score"]["fires_put_out"] / lit, 1
        ),
        "burning": Outcome("seconds that a fire burns", "burning s", lambda r, lit: float(r["burning"]) / lit, 1),
        "charge": Outcome("charge of the battery, %", "charge %", lambda r, lit: 100 * float(r["charge"]), 1),
        "contacts": Outcome(
            "contacts in ten minutes",
            "contacts",
            lambda r, lit: 6000 * float(r["score"]["contacts"]) / max(1, int(r["ticks"])),
        ),
        "patrol": Outcome(
            "time on patrol, %",
            "patrol %",
            lambda r, lit: 100 * r["behaviors"].get("patrol", 0) / max(1, sum(r["behaviors"].values())),
            1,
        ),
    }
)
"""By a short name. Fires are the same in all nights of a seed, so what is about them is a ratio of means."""


@dataclass(frozen=True)
class Effect:
    """What an outcome gains when an entry's odds are raised by the amount; a 95 % interval, over n pairs.

    ``clear``: it would be beside zero also after allowing for all entries that were looked at (Bonferroni).
    """

    value: float
    low: float
    high: float
    n: int
    clear: bool

    @property
    def seen(self) -> bool:
        """Whether the interval lies beside zero. Of twenty entries without any effect one will."""
        return self.low > 0 or self.high < 0


class Nights:
    """Nights with published and perturbed tables, and what is to be learnt from them."""

    def __init__(self, cases: Sequence[Case], results: Sequence[Result]) -> None:
        perturbed = [case for case in cases if case["signs"]]
        self._step = math.log(1 + float(perturbed[0]["amount"]))
        self._opened = float(perturbed[0].get("opened", 0.0))
        self._published: dict[int, Result] = {}
        self._perturbed: dict[int, list[Result]] = defaultdict(list)
        self.perturbed = entries_of(cases)
        """The entries that are."""
        ran = {(int(case["seed"]), str(case["signs"])): one for case, one in zip(cases, results, strict=True)}
        rows: list[Array] = []
        self._pairs: list[tuple[Result, Result]] = []
        for case, result in zip(cases, results, strict=True):
            seed, marks = int(case["seed"]), str(case["signs"])
            if not marks:
                self._published[seed] = result
                continue
            self._perturbed[seed].append(result)
            if marks.lstrip("0")[0] == "+":
                signs = signs_of(case)
                rows.append(np.array([signs.get(entry, 0) for entry in self.perturbed], np.float64))
                self._pairs.append((result, ran[seed, marks.translate(_OPPOSITE)]))
        signed = np.array(rows).reshape(len(rows), len(self.perturbed))
        self.met = self._situations()
        """Ticks of a mean published night in each situation with each Behavior_t-1."""
        self.otherwise = dict(zip(ENTRIES, otherwise(self.met, self._step, self._opened).tolist(), strict=True))
        """Decisions of such a night that come out otherwise when an entry is raised, exact to the first order."""
        told = [place for place, entry in enumerate(self.perturbed) if self.otherwise[entry] >= RARELY]
        self.entries = tuple(self.perturbed[place] for place in told)
        """Those whose effects are looked for: the others do not get so far as to change a night's outcome."""
        self._signs = signed[:, told]
        self._contrasts = self._signs - self._column_means()
        lit = [float(one["score"]["fires_lit"]) for one in results]
        self.lit = float(np.mean(lit)) or 1.0
        """Fires in a mean night."""

    @property
    def published(self) -> list[Result]:
        """The nights with the tables as printed, one a seed."""
        return list(self._published.values())

    @property
    def together(self) -> bool:
        """Whether all effects are fitted together, which takes the others' out of each one's interval: when every
        pair perturbs everything, and there are enough pairs."""
        enough = len(self._pairs) >= np.linalg.matrix_rank(self._contrasts) + _SPARE
        return bool((self._signs != 0).all()) and bool(enough)

    def effects(self, outcome: str) -> dict[Entry, Effect]:
        """Of each entry on an outcome."""
        value = OUTCOMES[outcome].value
        halves = np.array([(value(a, self.lit) - value(b, self.lit)) / 2 for a, b in self._pairs])
        if self.together:
            return dict(zip(self.entries, _fitted(self._contrasts, halves), strict=True))
        found = {}
        for place, entry in enumerate(self.entries):
            there = self._signs[:, place] != 0
            found[entry] = _effect(halves[there] * self._contrasts[there, place], len(self.entries))
        return found

    def levels(self, outcome: str) -> tuple[list[float], list[float]]:
        """For each seed the published night's value and the mean of the perturbed ones'."""
        value = OUTCOMES[outcome].value
        seeds = [seed for seed in self._published if self._perturbed[seed]]
        return (
            [value(self._published[seed], self.lit) for seed in seeds],
            [float(np.mean([value(one, self.lit) for one in self._perturbed[seed]])) for seed in seeds],
        )

    def spread(self, outcome: str) -> float:
        """The deviation of an outcome between nights of one seed whose tables differ."""
        value = OUTCOMES[outcome].value
        within = [np.var([value(one, self.lit) for one in nights], ddof=1) for nights in self._perturbed.values()]
        return math.sqrt(float(np.mean(within)))

    def _situations(self) -> Met:
        sums: Counter[tuple[Situation, str]] = Counter()
        for one in self._published.values():
            sums.update(met(one))
        return {key: ticks / len(self._published) for key, ticks in sums.items()}

    def _column_means(self) -> Array:
        """What is to be taken off each sign. All entries of a column by the same factor change nothing, so their
        effects sum to zero; where a pair perturbs all that matters of a column, the mean of its signs is noise."""
        means = np.zeros_like(self._signs)
        columns: dict[tuple[int, int], set[Entry]] = defaultdict(set)
        for entry in movable():
            if self.otherwise[entry] >= RARELY:
                columns[entry.table, entry.column].add(entry)
        for wanted in columns.values():
            if wanted.issubset(self.entries):
                places = [i for i, e in enumerate(self.entries) if e in wanted]
                here = self._signs[:, places]
                full = (here != 0).all(axis=1)
                means[np.ix_(full, places)] = here[full].mean(axis=1, keepdims=True)
        return means


_OPPOSITE = str.maketrans("+-", "-+")


def _fitted(contrasts: Array, halves: Array) -> list[Effect]:
    """Least squares; of the many solutions the one whose effects sum to zero in each column."""
    from scipy.stats import t

    n, looked_at = contrasts.shape
    inverse = np.linalg.pinv(contrasts.T @ contrasts, rcond=_RANK, hermitian=True)
    values = inverse @ contrasts.T @ halves
    freedom = n - int(np.linalg.matrix_rank(contrasts))
    variance = float(((halves - contrasts @ values) ** 2).sum()) / freedom
    errors = np.sqrt(variance * np.maximum(0.0, np.diag(inverse)))
    # An entry that is looked at alone in its column has no effect, by the constraint; rounding would leave one.
    values, errors = (np.where(np.abs(some) < _NOTHING, 0.0, some) for some in (values, errors))
    usual, wide = (float(t.ppf(1 - _LEVEL / 2 / tests, freedom)) for tests in (1, looked_at))
    return [
        Effect(float(v), float(v - usual * e), float(v + usual * e), n, clear=bool(abs(v) > wide * e > 0))
        for v, e in zip(values, errors, strict=True)
    ]


def _effect(shares: Array, looked_at: int) -> Effect:
    """Of independent pairs' shares in it; of one pair nothing is known of its spread."""
    from scipy.stats import t

    n = len(shares)
    middle = float(shares.mean())
    if n < 2:
        return Effect(middle, -math.inf, math.inf, n, clear=False)
    error = float(shares.std(ddof=1)) / math.sqrt(n)
    half = error * float(t.ppf(1 - _LEVEL / 2, n - 1))
    wide = error * float(t.ppf(1 - _LEVEL / 2 / looked_at, n - 1))
    return Effect(middle, middle - half, middle + half, n, clear=abs(middle) > wide > 0)
