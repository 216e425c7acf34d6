"""Tables and products of them as lines of source: what of an expression needs no sum.

`brp.plan` adds the sums, the cases and the questions within.
"""

from __future__ import annotations

from collections.abc import Generator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brp import tables
from brp.expression import Leaf, Node, Product, Slice
from brp.factors import LaidOut
from brp.source import Source
from brp.tables import Sizes, logs_of, size, written
from brp.variables import Variable, cells

__all__ = ["Axes", "Emission", "Products", "Shape"]

ROWS = 3
"""So many densities over one variable are multiplied by adding their logarithms."""
LISTED = 4096
"""A table of at most so many rows is a list of them."""

Array = NDArray[np.float64]
Shape = tuple[int, ...]
Axes = tuple[Variable, ...]
Emission = Generator[tuple[Any, ...], str, str]
"""A task of `climb` that results in the name of an array."""


class Products:
    """Writes nodes as named arrays; knows what is a table, and looks it up.

    One that works ``within`` another writes into a source of its own that shares the other's constants.
    """

    def __init__(self, known: Axes, soft: Axes, sizes: Sizes, within: Products | None = None) -> None:
        self.known = known
        self.soft = soft
        self.sizes = sizes
        self.rank = {v: number for number, v in enumerate(known)}
        self.place = {v: f"i{number}" for number, v in enumerate(known)}
        self.weights = {v: f"w{number}" for number, v in enumerate(soft)}
        told = [*self.place.values(), *self.weights.values()]
        self.source: Source = Source(told, None if within is None else within.source)
        self.made: dict[tuple[int, Axes, Shape, bool], str] = {}
        self.lists: dict[int, str] = {}
        self.depth: dict[str, int] = {}
        self.kept: list[Node] = [] if within is None else within.kept
        """Nodes made on the way: their ids are keys, and must stay theirs."""
        self.distributions: set[str] = set()
        """Names of arrays that sum to one already."""
        self.gaps: set[str] = set()
        """Names of what was looked up in tables of which some rows have no answer, and are nan."""
        self.root: Node | None = None

    def _emit(self, here: Node, order: Axes, shape: Shape, scale: bool) -> Emission:
        """The name of an array of ``shape`` that holds ``here`` with the axes of ``order``.

        ``order`` has every free variable of the node (others have length 1), and ``shape`` is that array reshaped.
        ``scale``: whether the array may be multiplied by any one number.
        """
        raise NotImplementedError

    def _everything(self, here: Node, order: Axes) -> Array:
        """All of a node as an array; nan where a question has no answer."""
        raise NotImplementedError

    # What can be folded.

    def _free(self, here: Node) -> frozenset[Variable]:
        """Its free variables: where a table is made of a part, those that are known around it as well."""
        return here.scope if self.known or self.soft or not here.evidence else here.scope | here.evidence

    def _lengths(self, here: Node, order: Axes) -> Shape:
        free = self._free(here)
        return tuple([len(v) if v in free else 1 for v in order])

    def _length(self, nodes: Sequence[Node], variable: Variable) -> int:
        return len(variable) if any(variable in self._free(n) for n in nodes) else 1

    def _folds(self, here: Node) -> bool:
        if isinstance(here, Leaf):
            return size(here) <= (tables.LIGHT if here.density.light else tables.LEAF)
        # With nothing known, and of the whole, a fold would be the very computation that is being compiled.
        return bool(self.known or self.soft) and here is not self.root and self.sizes.folds(here)

    def _keep(self, here: Node) -> Node:
        """A node that was made here."""
        self.sizes.add(here)
        self.kept.append(here)
        return here

    def _members(self, here: Node) -> tuple[Node, ...]:
        """The factors of a product that is not a table."""
        return here.children if isinstance(here, Product) and not self._folds(here) else (here,)

    # Names of arrays.

    def _reshaped(self, name: str, now: Shape, shape: Shape) -> str:
        if now == shape:
            return name
        result = self.source.register(f"{name}.reshape({shape})")
        self.depth[result] = self.depth.get(name, 0)
        return result

    def _turned(self, name: str, now: Axes, flat: Shape, wanted: Axes, shape: Shape) -> str:
        """An array of shape ``flat`` over the axes ``now``, with these in the order wanted, in a shape."""
        if wanted == now:
            return self._reshaped(name, flat, shape)
        name = self._reshaped(name, flat, tuple(map(len, now)))
        turned = self.source.register(f"{name}.transpose({tuple(now.index(v) for v in wanted)})")
        self.depth[turned] = self.depth.get(name, 0)
        return self._reshaped(turned, tuple(map(len, wanted)), shape)

    def _number(self, here: Node) -> Emission:
        """A node without free variables, as one number of Python's where that is quicker than numpy's."""
        if isinstance(here, Slice) and not self._folds(here):
            child = here.children[0]
            at = [(v, place) for v, place in here.fixed.items() if v not in self.place and v in self._free(child)]
            if len(at) == 1:
                # All of the vector at once: what stands here for one case stands in the others for theirs.
                ((v, place),) = at
                if id(child) not in self.lists:
                    name = yield (self._emit, child, (v,), (len(v),), False)
                    self.lists[id(child)] = self.source.register(f"{name}.tolist()")
                return f"{self.lists[id(child)]}[{place}]"
        return (yield (self._emit, here, (), (), False))

    # Tables and densities.

    def _axes(self, here: Node, order: Axes) -> tuple[Axes, Axes]:
        """The known variables that a table of the node has axes for, and all its axes, those first."""
        evidence = (v for v in here.evidence or () if v in self.rank)
        known = tuple(sorted(evidence, key=self.rank.__getitem__))
        free = self._free(here)
        return known, (*known, *(v for v in order if v in free))

    def _table(self, here: Node, order: Axes, shape: Shape, scale: bool) -> str:
        """A table, the known variables first: what is asked of it is one contiguous piece."""
        known, axes = self._axes(here, order)
        if isinstance(here, Leaf):
            # Questions of one description look the same numbers up: they have one table together.
            made = here.density.laid_out
            key = known, axes, tuple(here.fixed.items()), shape, scale
            if key not in made:
                made[key] = _laid_out(written(here, axes), known, axes, shape, scale)
            table = made[key]
        else:
            table = _laid_out(self._everything(here, axes), known, axes, shape, scale)
        name = self._looked_up(table, shape)
        if table.gaps:
            self.gaps.add(name)
        return name

    def _looked_up(self, table: LaidOut, shape: Shape) -> str:
        values, known = table.values, table.axes[: table.known]
        if not known:
            return self.source.array(values)
        if (len(known) == 1 and shape) or cells(known) > LISTED:
            name = self.source.array(values)
            return self.source.register(f"{name}[{', '.join(self.place[v] for v in known)}]")
        # A list of rows, looked up by one number, which numpy's indexing by several is slow beside.
        rows = self.source.rows(values.reshape(cells(known), *shape))
        return self.source.register(f"{rows}[{self._cell(known)}]")

    def _cell(self, known: Axes) -> str:
        """The number of the row that is known, in a list of all."""
        cell, stride = [], 1
        for v in reversed(known):
            cell.append(f"{self.place[v]} * {stride}" if stride > 1 else self.place[v])
            stride *= len(v)
        return " + ".join(cell)

    def _density(self, here: Leaf, order: Axes, shape: Shape) -> str:
        """A density too large for a table, computed where it is asked."""
        free = self._free(here)
        axes = tuple(v for v in order if v in free)
        mesh = dict(zip(axes, np.ix_(*(np.arange(len(v)) for v in axes)), strict=True))
        arguments = []
        for v in here.density.scope:
            if v in here.fixed:
                arguments.append(str(here.fixed[v]))
            else:
                arguments.append(self.place[v] if v in self.place else self.source.constant(mesh[v]))
        log = self.source.constant(here.density.log)
        full = tuple(map(len, axes))
        return self.source.register(
            f"np.broadcast_to(np.exp({log}({', '.join(arguments)})), {full}).reshape({shape})"
        )

    # Products.

    def _product(self, children: Sequence[Node], order: Axes, shape: Shape, scale: bool) -> Emission:
        if len(children) == 1:
            return (yield (self._emit, children[0], order, shape, scale))
        natural = tuple(self._length(children, v) for v in order)
        rows = self._same_row(children) if scale else []
        if len(rows) >= ROWS:
            taken = set(map(id, rows))
            rest = [child for child in children if id(child) not in taken]
            name = self._rows(rows, order)
            own = self._lengths(rows[0], order)
            if not rest:
                return self._reshaped(name, own, shape)
            name = self._reshaped(name, own, tuple(self._length(rows, v) for v in order))
            others = yield from self._product(rest, order, tuple(self._length(rest, v) for v in order), scale)
            result = self.source.register(f"{name} * {others}")
            self.depth[result] = self.depth.get(others, 0)
            return self._reshaped(result, natural, shape)
        single = [child for child in children if not self._free(child)]
        arrays = sorted((child for child in children if self._free(child)), key=lambda c: cells(self._free(c)))
        names = []
        if arrays:
            for child in single:
                names.append((yield (self._number, child)))
        else:
            arrays = single
        left = list(map(self._free, arrays))
        for child in arrays:
            name = yield (self._emit, child, order, self._lengths(child, order), scale)
            free = left.pop(0)
            if scale and self._even(name) and free <= frozenset().union(*left):
                continue  # a constant of equal numbers only scales
            left.append(free)
            names.append(name)
        result = self.source.register(" * ".join(names)) if names else self.source.array(np.ones(natural))
        self.depth[result] = max((self.depth.get(name, 0) for name in names), default=0)
        return self._reshaped(result, natural, shape)

    def _even(self, name: str) -> bool:
        """Whether it is a constant of equal numbers, not zero."""
        values = self.source.known(name)
        return values is not None and bool(values.size and values.flat[0] > 0 and (values == values.flat[0]).all())

    def _same_row(self, nodes: Sequence[Node]) -> list[Leaf]:
        """The densities of one same free variable that are looked up by what is known; the most of them."""
        rows: dict[frozenset[Variable], list[Leaf]] = {}
        for here in nodes:
            if isinstance(here, Leaf) and here.evidence and len(self._free(here)) == 1 and self._folds(here):
                rows.setdefault(self._free(here), []).append(here)
        return max(rows.values(), key=len, default=[])

    def _rows(self, rows: Sequence[Leaf], order: Axes) -> str:
        """Many densities over one variable multiplied: as a sum of logarithms, which cannot underflow."""
        known, _ = zip(*(self._axes(here, order) for here in rows), strict=True)
        logs = [np.ascontiguousarray(logs_of(here, self._axes(here, order)[1])) for here in rows]
        if all(part.shape[-1] == 2 and cells(k) <= LISTED and np.isfinite(part).all()
               for k, part in zip(known, logs, strict=True)):  # fmt: skip
            # Of two values their ratio is enough, and numbers are added faster than rows of two.
            terms = [
                f"{self.source.rows((part[..., 1] - part[..., 0]).ravel())}[{self._cell(k)}]"
                for k, part in zip(known, logs, strict=True)
            ]
            result = self.source.register(f"either({' + '.join(terms)})")
            self.distributions.add(result)
            return result
        names = []
        for k, part in zip(known, logs, strict=True):
            name = self.source.array(part)
            names.append(self.source.register(f"{name}[{', '.join(self.place[v] for v in k)}]"))
        total = self.source.register(" + ".join(names))
        largest = self.source.register(f"most({total})")
        self.source.guard(f"{largest} > LEAST")
        return self.source.register(f"exp({total} - {largest})")


def _laid_out(values: Array, known: Axes, axes: Axes, shape: Shape, scale: bool) -> LaidOut:
    """``values`` over ``axes``, of which ``known`` are the first, as what is looked up by these in ``shape``."""
    # A known variable that makes no difference needs no axis.
    for v in known:
        axis = axes.index(v)
        first = values.take([0], axis)
        if len(v) > 1 and (first == values.take([1], axis)).all() and (first == values).all():
            axes = tuple(a for a in axes if a != v)
            values = first.squeeze(axis)
    known = tuple(v for v in known if v in axes)
    gaps = bool(np.isnan(values).any())
    if scale:
        rest = tuple(range(len(known), len(axes)))
        largest = values.max(axis=rest, keepdims=True)
        values = values / np.where(largest > 0, largest, 1.0)  # nan stays, and is found at the end
    values = np.ascontiguousarray(values).reshape(tuple([len(v) for v in known]) + shape)
    return LaidOut(values, axes, len(known), gaps)
