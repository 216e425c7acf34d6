"""The numeric phase for many rows of evidence at once: the plan of `brp.plan` with one axis more.

That axis is a variable which numbers the rows: whatever depends on what is known has it, and all else is done once
for all rows. A row that the plan cannot answer (impossible, or too near to underflowing) is nan, and left to
logarithms; no other row suffers from it.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import prod
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brp.batch import answered
from brp.evidence import Evidence
from brp.expression import Conditional, Leaf, Node, Otherwise, Soft, Split, Sum, climb, postorder
from brp.factors import LaidOut
from brp.plan import Compiler, do
from brp.products import Axes, Emission, Shape
from brp.source import TINY, Run
from brp.tables import Sizes, logs_of
from brp.variables import Variable, cells

__all__ = ["Rows", "unanswered"]

NUMBERS = 500_000
"""So many numbers of an array are worked on at a time."""
MOST = 1024
"""And no more rows than this."""

Array = NDArray[np.float64]


class Rows:
    """The answers of a question to many rows of evidence, so many at a time; compiled when it is first needed."""

    def __init__(self, start: Node, known: Axes, searched: Axes, soft: Axes, largest: int) -> None:
        self.start = start
        self.known = known
        self.searched = searched
        self.soft = soft
        self.largest = largest
        self.count = max(1, min(MOST, NUMBERS // largest))
        self._run: Run | None = None

    def answer(self, count: int, evidence: Evidence) -> Array:
        """The answers of all rows, shape ``(count, ...)``; nan in the rows that are impossible."""
        if 2 * count < self.count or not _plain(self.start, self.known):
            return answered(self.start, self.searched, count, evidence, self.largest)
        if self._run is None:
            self._run = _compiled(self.start, self.known, self.searched, self.soft, self.count)
        shape = tuple(map(len, self.searched))
        answers = np.empty((count, *shape))
        told = [evidence.places[v] for v in self.known], [evidence.weights[v] for v in self.soft]
        for first in range(0, count, self.count):
            chosen = np.arange(first, first + self.count) % count  # the last ones are filled up with the first
            with np.errstate(all="ignore"):  # nan says what is not to be trusted
                made = self._run([np.asarray(column)[chosen] for columns in told for column in columns])
            part = answers[first : first + self.count]
            part[...] = np.nan if made is None else made[: len(part)]
        doubtful = np.flatnonzero(unanswered(answers))
        if len(doubtful):
            places = {v: column[doubtful] for v, column in evidence.places.items()}  # type: ignore[index]  # columns here
            weights = {v: column[doubtful] for v, column in evidence.weights.items()}
            again = Evidence(places, weights)
            answers[doubtful] = answered(self.start, self.searched, len(doubtful), again, self.largest)
        return answers


def unanswered(answers: Array) -> NDArray[np.bool_]:
    """Which rows have no answer: they are nan throughout, so that their first number tells."""
    first: Any = (slice(None), *(0 for _ in answers.shape[1:]))
    return np.asarray(np.isnan(answers[first]))


def _plain(start: Node, known: Axes) -> bool:
    """Whether no question within searches what is known around it, which must be normalised first."""
    return not any(
        isinstance(here, Conditional) and not frozenset(known).isdisjoint(here.variables)
        for here in postorder(start)
    )


def _compiled(start: Node, known: Axes, searched: Axes, soft: Axes, count: int) -> Run:
    rows = Variable("row", range(count)).hidden()
    compiler = _ManyRows(known, soft, Sizes(start), rows)
    compiler.root = start
    while isinstance(compiler.root, Otherwise):
        compiler.root = compiler.root.children[0]
    order = (rows, *searched)
    shape = tuple(map(len, order))
    own = compiler._lengths(start, order)
    result = climb(do, compiler._emit, start, order, own, False)
    return compiler.source.function("ask", f"np.broadcast_to({result}, {shape})")[1]


class _ManyRows(Compiler):
    """Places and weights are columns here, an element or a row for each row of evidence."""

    def __init__(self, known: Axes, soft: Axes, sizes: Sizes, rows: Variable) -> None:
        super().__init__(known, soft, sizes)
        self.row = rows
        self._order: Axes = ()
        self._shape: Shape = ()
        self._told = False

    def _free(self, here: Node) -> frozenset[Variable]:
        return here.scope | {self.row} if here.evidence is None or here.evidence else here.scope

    def _laid(self, name: str, axes: Axes, order: Axes, shape: Shape) -> str:
        """An array over ``axes``, in the order and the shape asked."""
        wanted = tuple(v for v in order if v in axes)
        return self._turned(name, axes, tuple(map(len, axes)), wanted, shape)

    def _emit(self, here: Node, order: Axes, shape: Shape, scale: bool) -> Emission:
        if isinstance(here, Soft):
            return self._laid(self.weights[here.variable], (self.row, here.variable), order, shape)
        return (yield from super()._emit(here, order, shape, scale))

    def _looked_up(self, table: LaidOut, shape: Shape) -> str:
        known, free = table.axes[: table.known], table.axes[table.known :]
        name = self.source.array(table.values)
        if known:
            name = self.source.register(f"{name}[{', '.join(self.place[v] for v in known)}]")
        elif self._told:  # what is known makes no difference
            name = self.source.register(f"np.broadcast_to({name}, {(len(self.row), *map(len, free))})")
        return self._laid(name, (self.row, *free) if self._told else free, self._order, self._shape)

    def _table(self, here: Node, order: Axes, shape: Shape, scale: bool) -> str:
        self._order, self._shape, self._told = order, shape, self.row in self._free(here)
        known, axes = self._axes(here, order)
        return super()._table(here, order, tuple(map(len, axes[len(known) :])), False)

    def _axes(self, here: Node, order: Axes) -> tuple[Axes, Axes]:
        return super()._axes(here, tuple(v for v in order if v != self.row))

    def _density(self, here: Leaf, order: Axes, shape: Shape) -> str:
        axes = tuple(v for v in order if v in here.scope)
        mesh = dict(zip(axes, np.ix_(*(np.arange(len(v)) for v in axes)), strict=True))
        column = (-1, *(1 for _ in axes))
        arguments = []
        for v in here.density.scope:
            if v in here.fixed:
                arguments.append(str(here.fixed[v]))
            elif v in self.place:
                arguments.append(f"{self.place[v]}.reshape({column})")
            else:
                arguments.append(self.source.constant(mesh[v]))
        made = f"np.exp({self.source.constant(here.density.log)}({', '.join(arguments)}))"
        has = (self.row, *axes) if self.row in self._free(here) else axes
        name = self.source.register(f"np.broadcast_to({made}, {tuple(map(len, has))})")
        return self._laid(name, has, order, shape)

    def _same_row(self, nodes: Sequence[Node]) -> list[Leaf]:
        rows: dict[frozenset[Variable], list[Leaf]] = {}
        for here in nodes:
            if isinstance(here, Leaf) and here.evidence and len(here.scope) == 1 and self._folds(here):
                rows.setdefault(here.scope, []).append(here)
        return max(rows.values(), key=len, default=[])

    def _rows(self, rows: Sequence[Leaf], order: Axes) -> str:
        names = []
        for here in rows:
            known, axes = self._axes(here, order)
            name = self.source.array(np.ascontiguousarray(logs_of(here, axes)))
            names.append(f"{name}[{', '.join(self.place[v] for v in known)}]")
        total = self.source.register(" + ".join(names))
        largest = self.source.register(f"{total}.max(1, keepdims=True)")
        name = self.source.register(f"exp({total} - {largest})")  # minus infinity less itself: a row without answer
        (variable,) = rows[0].scope
        return self._laid(name, (self.row, variable), order, self._lengths(rows[0], order))

    def _sum(self, here: Sum, order: Axes, shape: Shape, scale: bool) -> Emission:
        # A row that underflows is found at the end, where its total is too small.
        return (yield from super()._sum(here, order, shape, False))

    def _choice(self, here: Split, order: Axes, shape: Shape, scale: bool) -> str:
        natural = self._lengths(here, order)
        at = order.index(self.row)
        result = self.source.variable(f"np.empty({natural})")
        made: dict[int, list[int]] = {}
        branches: dict[int, Node] = {}
        for number, branch in enumerate(here.children):
            made.setdefault(id(branch), []).append(number)
            branches[id(branch)] = branch
        for key, numbers in made.items():
            branch = branches[key]
            name = climb(do, self._emit, branch, order, self._lengths(branch, order), False)
            cases = np.isin(np.arange(len(here.variable)), numbers)
            chosen = f"{self.source.constant(cases)}[{self.place[here.variable]}]"
            mask = tuple(len(v) if k == at else 1 for k, v in enumerate(order))
            self.source.line(f"np.copyto({result}, {name}, where={chosen}.reshape({mask}))")
        return self._reshaped(result, natural, shape)

    def _conditional(self, here: Conditional, order: Axes, shape: Shape) -> Emission:
        child = here.children[0]
        free = self._free(here)
        rest = tuple(v for v in order if v in free and v not in here.variables)
        inner = (*rest, *here.variables)
        own = self._lengths(child, inner)
        name = yield (self._emit, child, inner, own, True)
        full = tuple(map(len, inner))
        if own != full:
            name = self.source.register(f"np.broadcast_to({name}, {full})")
        searched = cells(here.variables)
        flat = (prod(full[: len(rest)]), searched)
        name = self._reshaped(name, full, flat)
        total = self.source.register(f"{name}.dot({self.source.array(np.ones(searched))})")
        total = self.source.register(f"np.where({total} > {TINY}, {total}, np.nan)")
        result = self.source.register(f"{name} / {total}[:, None]")
        return self._turned(result, inner, flat, tuple(v for v in order if v in free), shape)
