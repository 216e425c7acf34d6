"""What is folded: which parts of a question are small enough to be written out as tables when it is compiled."""

from __future__ import annotations

from math import inf

import numpy as np
from numpy.typing import NDArray

from brp.expression import Leaf, Node, Sum, postorder
from brp.variables import Variable, cells

__all__ = ["FOLD", "LEAF", "LIGHT", "Sizes", "logs_of", "size", "written"]

FOLD = 300_000
"""The largest table, in numbers, that a part of a question (or all of it) is folded into when it is compiled."""
EFFORT = 20_000_000
"""The most numbers that are computed to fill one such table."""
LEAF = 8_000_000
"""The largest density that is written out as a table; above, it is computed where it is asked."""
LIGHT = 100_000
"""The same for a density that holds far fewer numbers than its table: Per of 10 000 values, two numbers a class."""

Array = NDArray[np.float64]


class Sizes:
    """Which nodes are small enough, with all inside them, to be tables."""

    def __init__(self, start: Node) -> None:
        self._effort: dict[int, float] = {}
        self.add(start)

    def add(self, start: Node) -> None:
        """Take up a node that was made later."""
        for here in postorder(start, self._effort):
            inside = size(here)
            if isinstance(here, Sum):
                inside *= cells(here.variables)
            for child in here.children:
                inside += self._effort[id(child)]
            self._effort[id(here)] = inside

    def folds(self, here: Node) -> bool:
        """Whether the node is to be a table."""
        return self._effort[id(here)] <= EFFORT and size(here) <= FOLD


def size(here: Node) -> float:
    """How many numbers a node is for all known values; infinity when they are too many."""
    if here.evidence is None:
        return inf
    return cells(here.scope) * cells(here.evidence) if here.evidence else cells(here.scope)


def written(leaf: Leaf, axes: tuple[Variable, ...]) -> Array:
    """A density as probabilities, an axis for each of ``axes``."""
    return np.exp(logs_of(leaf, axes))


def logs_of(leaf: Leaf, axes: tuple[Variable, ...]) -> Array:
    """A density's logarithms, an axis for each of ``axes``."""
    density = leaf.density
    table = density.table
    free = density.scope
    if leaf.fixed:
        free = tuple([v for v in free if v not in leaf.fixed])
        table = table[tuple([leaf.fixed.get(v, slice(None)) for v in density.scope])]
    return table if free == axes else table.transpose([free.index(v) for v in axes])
