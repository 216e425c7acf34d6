"""The joint distribution written out in full: what every exact answer is held against; no part of the engine."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brp import Term, Variable

Array = NDArray[np.float64]


@dataclass
class Joint:
    """A conditional table for each term, its axes those of ``term.of + term.given``."""

    tables: dict[Term, Array]

    @property
    def variables(self) -> list[Variable]:
        return [v for term in self.tables for v in term.of]

    def full(self) -> Array:
        axes = self.variables
        joint = np.ones([len(v) for v in axes])
        for term, table in self.tables.items():
            joint = joint * spread(table, term.variables, axes)
        return joint

    def conditional(self, term: Term) -> Array:
        """P(term.of | term.given), axes in the term's order; nan where what is given is impossible."""
        axes = self.variables
        unknown = tuple(axes.index(v) for v in axes if v not in term.variables)
        summed = self.full().sum(axis=unknown)
        left = [v for v in axes if v in term.variables]
        table = summed.transpose([left.index(v) for v in term.variables])
        with np.errstate(invalid="ignore"):
            answer: Array = table / table.sum(axis=tuple(range(len(term.of))))
        return answer

    def answer(self, term: Term, known: Mapping[Variable, Any]) -> Array:
        at = tuple(v.place(known[v]) for v in term.given)
        return self.conditional(term)[(slice(None),) * len(term.of) + at]


def spread(table: Array, axes: Sequence[Variable], wanted: Sequence[Variable]) -> Array:
    """``table`` with an axis for each of ``wanted``, of length 1 where it has none."""
    order = [list(axes).index(v) for v in wanted if v in axes]
    return table.transpose(order).reshape([len(v) if v in axes else 1 for v in wanted])


def distributions(rng: np.random.Generator, of: Sequence[int], given: Sequence[int], zeros: float) -> Array:
    """Random conditional tables, some of their numbers zero, none of their columns."""
    table = rng.dirichlet(np.full(int(np.prod(of)), 0.7), size=tuple(given)).reshape(*given, -1)
    table = np.maximum(table, 1e-6)
    table[rng.random(table.shape) < zeros] = 0
    table[..., rng.integers(table.shape[-1])] += 0.1
    table /= table.sum(axis=-1, keepdims=True)
    return np.moveaxis(table.reshape(*given, *of), range(len(given)), range(len(of), len(of) + len(given)))
