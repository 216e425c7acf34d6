"""The numeric phase of section 3.4: a simplified question as straight-line numpy, compiled once, asked many times.

The compiled function works with probabilities, not with logarithms: sums are then products of matrices. Two things
keep it right where probabilities get small. Every few sums the numbers are scaled up again, and a total below
`TINY` is not trusted: the function returns None, and the caller computes in logarithms (`brp.logs`). Whatever
underflowed on the way to a total above `TINY` was smaller than the total by more than 50 powers of ten.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Generator, Sequence
from dataclasses import dataclass
from math import inf
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brp.evidence import weigh
from brp.expression import Conditional, Leaf, Node, Otherwise, Product, Slice, Soft, Split, Sum, climb, postorder
from brp.logs import logarithms
from brp.variables import Variable, cells

__all__ = ["FOLD", "Compiled", "Sizes", "compiled", "probabilities"]

FOLD = 300_000
"""The largest table, in numbers, that a part of a question (or all of it) is folded into when it is compiled."""

TINY = 1e-250
EFFORT = 20_000_000
"""The most numbers that are computed to fill one such table."""
LEAF = 8_000_000
"""The largest density that is written out as a table; above, it is computed where it is asked."""
LIGHT = 100_000
"""The same for a density that holds far fewer numbers than its table: Per of 10 000 values, two numbers a class."""
SHARED = 65_536
"""The bytes up to which a table is compared with those that are there already."""
NAMES = re.compile(r"\b[iw][0-9]+\b")
"""What is told, in the source of a plan."""
ROWS = 3
"""So many densities over one variable are multiplied by adding their logarithms."""
LISTED = 4096
"""A table of at most so many rows is a list of them."""
SUMS = 8
"""How many sums may follow one another before their result is scaled up."""

FEW = 16
"""So few numbers are added faster by Python than by numpy."""
WRITTEN = 200
"""So many variables may be told by keyword with a line of source for each."""

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Compiled:
    """A function from what is told (places, or values by keyword) to probabilities, or to None, and its source."""

    run: Callable[[Any], Array | None]
    source: str


def probabilities(start: Node, order: Sequence[Variable]) -> Array:
    """All of ``start`` as an array with an axis for each of ``order``; nan where a question has no answer."""
    shape = tuple(map(len, order))
    quick = compiled(start, (), tuple(order)).run(())
    values = quick if quick is not None else np.exp(logarithms(start, order))
    return np.ascontiguousarray(np.broadcast_to(values, shape))


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


def compiled(
    start: Node,
    known: tuple[Variable, ...],
    order: tuple[Variable, ...],
    sizes: Sizes | None = None,
    soft: tuple[Variable, ...] = (),
    keywords: bool = False,
) -> Compiled:
    """Compile ``start``: known values in, an array with an axis for each of ``order`` out.

    An axis of a variable that ``start`` does not depend on has length 1. What is told when it runs are the places
    of ``known``, then the weights of ``soft``; with ``keywords`` a mapping from the keyword of each of them to its
    value, or to what `weigh` takes. A mapping that does not fit raises `KeyError`, `TypeError` or `EvidenceError`.
    """
    return _Compiler(known, soft, sizes or Sizes(start)).compile(start, order, keywords)


def _written(leaf: Leaf, axes: tuple[Variable, ...]) -> Array:
    """A density as probabilities, an axis for each of ``axes``."""
    return np.exp(_logs(leaf, axes))


def _logs(leaf: Leaf, axes: tuple[Variable, ...]) -> Array:
    """A density's logarithms, an axis for each of ``axes``."""
    density = leaf.density
    table = density.table
    free = density.scope
    if leaf.fixed:
        free = tuple([v for v in free if v not in leaf.fixed])
        table = table[tuple([leaf.fixed.get(v, slice(None)) for v in density.scope])]
    return table if free == axes else table.transpose([free.index(v) for v in axes])


class _Compiler:
    """Turns an expression into the source of a Python function over named arrays."""

    def __init__(
        self,
        known: tuple[Variable, ...],
        soft: tuple[Variable, ...],
        sizes: Sizes,
        names: dict[str, Any] | None = None,
    ) -> None:
        self.known = known
        self.soft = soft
        self.weights = {v: f"w{number}" for number, v in enumerate(soft)}
        self.sizes = sizes
        self.rank = {v: number for number, v in enumerate(known)}
        self.place = {v: f"i{number}" for number, v in enumerate(known)}
        self.names: dict[str, Any] = (
            {"np": np, "exp": np.exp}
            | {
                "TINY": TINY,
                "LEAST": -np.inf,
            }
            if names is None
            else names
        )
        self.lines: list[str] = []
        self.made: dict[tuple[int, tuple[Variable, ...], tuple[int, ...], bool], str] = {}
        self.depth: dict[str, int] = {}
        self.registers = 0
        self.sources: list[str] = []
        self.root: Node | None = None

    def compile(self, start: Node, order: tuple[Variable, ...], keywords: bool) -> Compiled:
        self.root = start
        while isinstance(self.root, Otherwise):
            self.root = self.root.children[0]
        shape = self._lengths(start, order)
        result = climb(self._emit, start, order, shape, False)
        source, run = self._function("ask", result, self._lookup() if keywords else None)
        self.names.pop("tables", None)
        return Compiled(run, "\n\n".join([*self.sources, source]))

    def _function(
        self, name: str, result: str, lookup: Sequence[str] | None = None
    ) -> tuple[str, Callable[[Any], Array | None]]:
        body = list(self.lines)
        told = [*self.place.values(), *self.weights.values()]
        used = set(NAMES.findall("\n".join([*body, result])))
        if lookup:
            body[:0] = lookup
        elif len(used) * 3 < len(told):
            body[:0] = [f"{name} = e[{number}]" for number, name in enumerate(told) if name in used]
        elif told:
            body.insert(0, f"{', '.join(told)}, = e")
        source = "\n    ".join([f"def {name}(e):", *body, f"return {result}"])
        space: dict[str, Any] = {}
        exec(compile(source, "<plan>", "exec"), self.names, space)  # noqa: S102  (our own text: straight-line numpy)
        return source, space[name]

    def _lookup(self) -> list[str]:
        """Lines from what is told by keyword, ``e``, to places and weights; none where only places are told.

        Weights that are plainly in order are taken as they are. `weigh` has the last word about all others.
        """
        told = [*self.place.values(), *self.weights.values()]
        lines = [f"if len(e) != {len(told)}: raise KeyError"]
        if len(told) > WRITTEN:  # a loop compiles faster than as many lines
            places = self._constant([(v.keyword, v.places) for v in self.known])
            weights = self._constant([(v.keyword, v) for v in self.soft])
            self.names["weigh"] = weigh
            every = f"*[steps[e[k]] for k, steps in {places}], *[weigh(v, e[k]) for k, v in {weights}]"
            return [*lines, f"e = [{every}]", f"{', '.join(told)}, = e"]
        lines += [f"{name} = {self._constant(v.places)}[e[{v.keyword!r}]]" for v, name in self.place.items()]
        for v, name in self.weights.items():
            self.names |= {"weigh": weigh, "ndarray": np.ndarray, "float64": np.dtype(np.float64)}
            lines.append(f"{name} = e[{v.keyword!r}]")
            fits = f"type({name}) is ndarray and {name}.dtype is float64 and {name}.shape == ({len(v)},)"
            if len(v) <= FEW:
                parts = [f"{name}_{place}" for place in range(len(v))]
                positive = " and ".join(f"{part} >= 0" for part in parts)
                fine = f"{positive} and 1e-9 < {' + '.join(parts)} < 1e9"
                listed = f"{', '.join(parts)}, = {name}.tolist()"
            else:
                listed, fine = f"l = {name}.tolist()", "min(l) >= 0 and 1e-9 < sum(l) < 1e9"
            again = f"{name} = weigh({self._constant(v)}, {name})"
            lines += [f"if {fits}:", f"    {listed}", f"    if not ({fine}): {again}", f"else: {again}"]
        if "(e)" in "\n".join(self.lines):  # the cases of a known command variable
            lines.append(f"e = ({''.join(f'{name}, ' for name in told)})")
        return lines

    # What can be folded.

    def _free(self, here: Node) -> frozenset[Variable]:
        """Its free variables: where a table is made of a part, those that are known around it as well."""
        return here.scope if self.known or self.soft or not here.evidence else here.scope | here.evidence

    def _lengths(self, here: Node, order: tuple[Variable, ...]) -> tuple[int, ...]:
        free = self._free(here)
        return tuple([len(v) if v in free else 1 for v in order])

    def _folds(self, here: Node) -> bool:
        if isinstance(here, Leaf):
            return size(here) <= (LIGHT if here.density.light else LEAF)
        # With nothing known, and of the whole, a fold would be the very computation that is being compiled.
        return bool(self.known or self.soft) and here is not self.root and self.sizes.folds(here)

    # Lines of source.

    def _register(self, code: str) -> str:
        name = f"r{self.registers}"
        self.registers += 1
        self.lines.append(f"{name} = {code}")
        return name

    def _constant(self, value: Any) -> str:
        name = f"t{len(self.names)}"
        self.names[name] = value
        return name

    def _array(self, table: Array) -> str:
        """A table as a constant: the same one for the same numbers, as they stand in a chain of equal terms."""
        if table.nbytes > SHARED:
            return self._constant(table)
        key = (table.shape, table.tobytes())
        tables: dict[Any, str] = self.names.setdefault("tables", {})
        if key not in tables:
            tables[key] = self._constant(table)
        return tables[key]

    def _emit(
        self, here: Node, order: tuple[Variable, ...], shape: tuple[int, ...], scale: bool
    ) -> Generator[tuple[Any, ...], str, str]:
        """The name of an array of ``shape`` that holds ``here`` with the axes of ``order``.

        ``order`` has every free variable of the node (others have length 1), and ``shape`` is that array reshaped.
        ``scale``: whether the array may be multiplied by any one number.
        """
        key = (id(here), order, shape, scale)
        if key not in self.made:
            if self._folds(here):
                self.made[key] = self._table(here, order, shape, scale)
            elif isinstance(here, Leaf):
                self.made[key] = self._density(here, order, shape)
            elif isinstance(here, Soft):
                self.made[key] = self._reshaped(self.weights[here.variable], (len(here.variable),), shape)
            elif isinstance(here, Sum):
                self.made[key] = yield from self._sum(here, order, shape, scale)
            elif isinstance(here, Split):
                self.made[key] = yield from self._split(here, order, shape, scale)
            elif isinstance(here, Conditional):
                self.made[key] = yield from self._conditional(here, order, shape)
            elif isinstance(here, Otherwise):
                self.made[key] = yield from self._otherwise(here, order, shape)
            elif isinstance(here, Slice):
                self.made[key] = yield from self._slice(here, order, shape)
            else:
                assert isinstance(here, Product)
                self.made[key] = yield from self._product(here.children, order, shape, scale)
        return self.made[key]

    def _table(self, here: Node, order: tuple[Variable, ...], shape: tuple[int, ...], scale: bool) -> str:
        """A table, the known variables first: what is asked of it is one contiguous piece."""
        known, axes = self._axes(here, order)
        values = _written(here, axes) if isinstance(here, Leaf) else probabilities(here, axes)
        if scale:
            rest = tuple(range(len(known), len(axes)))
            largest = values.max(axis=rest, keepdims=True)
            largest[~(largest > 0)] = 1.0  # nan stays, and is found at the end
            values = values / largest
        values = np.ascontiguousarray(values)
        if len(known) > 1 and cells(known) <= LISTED:
            # A list of rows, looked up by one number, which numpy's indexing by several is slow beside.
            rows = self._constant(list(values.reshape(cells(known), *shape)))
            cell, stride = [], 1
            for v in reversed(known):
                cell.append(f"{self.place[v]} * {stride}" if stride > 1 else self.place[v])
                stride *= len(v)
            return self._register(f"{rows}[{' + '.join(cell)}]")
        name = self._array(values.reshape(tuple([len(v) for v in known]) + shape))
        return self._register(f"{name}[{', '.join(self.place[v] for v in known)}]") if known else name

    def _density(self, here: Leaf, order: tuple[Variable, ...], shape: tuple[int, ...]) -> str:
        """A density too large for a table, computed where it is asked."""
        free = self._free(here)
        axes = tuple(v for v in order if v in free)
        mesh = dict(zip(axes, np.ix_(*(np.arange(len(v)) for v in axes)), strict=True))
        arguments = []
        for v in here.density.scope:
            if v in here.fixed:
                arguments.append(str(here.fixed[v]))
            else:
                arguments.append(self.place[v] if v in self.place else self._constant(mesh[v]))
        log = self._constant(here.density.log)
        full = tuple(map(len, axes))
        return self._register(f"np.broadcast_to(np.exp({log}({', '.join(arguments)})), {full}).reshape({shape})")

    def _product(
        self, children: Sequence[Node], order: tuple[Variable, ...], shape: tuple[int, ...], scale: bool
    ) -> Generator[tuple[Any, ...], str, str]:
        if len(children) == 1:
            return (yield (children[0], order, shape, scale))
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
            result = self._register(f"{name} * {others}")
            self.depth[result] = self.depth.get(others, 0)
            return self._reshaped(result, tuple(self._length(children, v) for v in order), shape)
        names = []
        for child in sorted(children, key=lambda child: cells(self._free(child))):
            own = self._lengths(child, order)
            names.append((yield (child, order, own, scale)))
        if not names:
            return self._constant(np.ones(shape))
        result = self._register(" * ".join(names))
        self.depth[result] = max(self.depth.get(name, 0) for name in names)
        return self._reshaped(result, tuple(self._length(children, v) for v in order), shape)

    def _same_row(self, nodes: Sequence[Node]) -> list[Node]:
        """The densities of one same free variable that are looked up by what is known; the most of them."""
        rows: dict[frozenset[Variable], list[Node]] = {}
        for here in nodes:
            if isinstance(here, Leaf) and here.evidence and len(self._free(here)) == 1 and self._folds(here):
                rows.setdefault(self._free(here), []).append(here)
        return max(rows.values(), key=len, default=[])

    def _rows(self, rows: Sequence[Node], order: tuple[Variable, ...]) -> str:
        """Many densities over one variable multiplied: as a sum of logarithms, which cannot underflow."""
        names = []
        for here in rows:
            assert isinstance(here, Leaf)
            known, axes = self._axes(here, order)
            name = self._array(np.ascontiguousarray(_logs(here, axes)))
            names.append(self._register(f"{name}[{', '.join(self.place[v] for v in known)}]"))
        total = self._register(" + ".join(names))
        largest = self._register(f"{total}.max()")
        self.lines.append(f"if not {largest} > LEAST: return None")
        return self._register(f"exp({total} - {largest})")

    def _axes(self, here: Node, order: tuple[Variable, ...]) -> tuple[tuple[Variable, ...], tuple[Variable, ...]]:
        """The known variables that a table of the node has axes for, and all its axes, those first."""
        evidence = (v for v in here.evidence or () if v in self.rank)
        known = tuple(sorted(evidence, key=self.rank.__getitem__))
        free = self._free(here)
        return known, (*known, *(v for v in order if v in free))

    def _length(self, nodes: Sequence[Node], variable: Variable) -> int:
        return len(variable) if any(variable in self._free(n) for n in nodes) else 1

    def _reshaped(self, name: str, now: tuple[int, ...], shape: tuple[int, ...]) -> str:
        if now == shape:
            return name
        result = self._register(f"{name}.reshape({shape})")
        self.depth[result] = self.depth.get(name, 0)
        return result

    def _sum(
        self, here: Sum, order: tuple[Variable, ...], shape: tuple[int, ...], scale: bool
    ) -> Generator[tuple[Any, ...], str, str]:
        child = here.children[0]
        if isinstance(child, Split) and child.variable in here.variables:
            rest = tuple(v for v in here.variables if v != child.variable)
            natural = self._lengths(here, order)
            names = []
            for branch in child.children:
                part = Sum(rest, branch) if rest else branch
                self.sizes.add(part)
                self.names[f"keep{len(self.names)}"] = part  # its id is a key of `made`
                own = self._lengths(part, order)
                names.append((yield (part, order, own, False)))
            return self._reshaped(self._register(" + ".join(names)), natural, shape)
        result = yield from self._contract(child, here.variables, order, shape, scale)
        depth = self.depth.get(result, 0) + 1
        if scale and depth >= SUMS:
            largest = self._register(f"{result}.max()")
            self.lines.append(f"if not {largest} > TINY: return None")
            result = self._register(f"{result} / {largest}")
            depth = 0
        self.depth[result] = depth
        return result

    def _contract(
        self,
        child: Node,
        variables: tuple[Variable, ...],
        order: tuple[Variable, ...],
        shape: tuple[int, ...],
        scale: bool,
    ) -> Generator[tuple[Any, ...], str, str]:
        """The sum of a product over ``variables``: small factors make weights, one matrix product does the rest."""
        summed = tuple([v for v in variables if v in child.scope])
        absent = cells([v for v in variables if v not in child.scope])
        members = child.children if isinstance(child, Product) and not self._folds(child) else (child,)
        big = max(members, key=lambda member: cells(self._free(member)), default=child)
        small = tuple(member for member in members if member is not big)
        light = frozenset().union(*[self._free(member) for member in small])
        heavy = self._free(big)
        shared = tuple(v for v in summed if v in light and v in heavy)
        if len(shared) < len(variables) or not small:
            # One factor alone, or sums that the two sides do not share.
            inner = (*order, *summed)
            lengths = tuple(self._length(members, v) for v in inner)
            product = yield from self._product(members, inner, lengths, scale)
            axes = tuple(range(len(order), len(inner)))
            result = self._register(f"{product}.sum({axes})" + (f" * {absent}" if absent != 1 else ""))
            self.depth[result] = self.depth.get(product, 0)
            return self._reshaped(result, lengths[: len(order)], shape)
        both = tuple(v for v in order if v in light and v in heavy)
        rows = tuple(v for v in order if v in light and v not in heavy)
        columns = tuple(v for v in order if v in heavy and v not in light)
        m, n, s = cells(rows), cells(columns), cells(shared)
        batch = (cells(both),) if both else ()
        left_shape = (*batch, *((m,) if rows else ()), s)
        right_shape = (*batch, s, *((n,) if columns else ()))
        if both:
            left_shape, right_shape = (*batch, m, s), (*batch, s, n)
        left = yield from self._product(small, (*both, *rows, *shared), left_shape, scale)
        right = yield (big, (*both, *shared, *columns), right_shape, scale)
        result = self._register(f"np.matmul({left}, {right})" if both else f"{left}.dot({right})")
        self.depth[result] = max(self.depth.get(left, 0), self.depth.get(right, 0))
        now = (*both, *rows, *columns)
        made = (*batch, *((m,) if rows or both else ()), *((n,) if columns or both else ()))
        wanted = tuple(v for v in order if v in now)
        if wanted != now:
            lengths = tuple(map(len, now))
            result = self._reshaped(result, made, lengths)
            turned = self._register(f"{result}.transpose({tuple(now.index(v) for v in wanted)})")
            self.depth[turned] = self.depth.get(result, 0)
            result, made = turned, tuple(map(len, wanted))
        return self._reshaped(result, made, shape)

    def _split(
        self, here: Split, order: tuple[Variable, ...], shape: tuple[int, ...], scale: bool
    ) -> Generator[tuple[Any, ...], str, str]:
        if here.variable in self.place:
            return self._choice(here, order, shape, scale)
        # The command variable is searched, or summed further out: the cases side by side.
        lengths = self._lengths(here, order)
        axis = order.index(here.variable)
        result = self._register(f"np.empty({lengths})")
        for number, branch in enumerate(here.children):
            own = self._lengths(branch, order)
            name = yield (branch, order, own, False)
            at = ", ".join([*(":" for _ in range(axis)), f"{number}:{number + 1}"])
            self.lines.append(f"{result}[{at}] = {name}")
        return self._reshaped(result, lengths, shape)

    def _choice(self, here: Split, order: tuple[Variable, ...], shape: tuple[int, ...], scale: bool) -> str:
        """A function for each value of a known command variable."""
        functions = []
        shared: dict[int, Callable[[Sequence[int]], Array | None]] = {}
        natural = self._lengths(here, order)
        for number, branch in enumerate(here.children):
            if id(branch) in shared:
                functions.append(shared[id(branch)])
                continue
            inner = _Compiler(self.known, self.soft, self.sizes, self.names)
            own = self._lengths(branch, order)
            result = climb(inner._emit, branch, order, own, scale)
            if own != natural:
                result = inner._register(f"np.broadcast_to({result}, {natural})")
            source, run = inner._function(f"case{number}", result)
            self.sources.extend([*inner.sources, source])
            functions.append(run)
            shared[id(branch)] = run
        cases = self._constant(tuple(functions))
        result = self._register(f"{cases}[{self.place[here.variable]}](e)")
        self.lines.append(f"if {result} is None: return None")
        return self._reshaped(result, natural, shape)

    def _conditional(
        self, here: Conditional, order: tuple[Variable, ...], shape: tuple[int, ...]
    ) -> Generator[tuple[Any, ...], str, str]:
        outside = [v for v in here.variables if v in self.place]
        if outside:
            return self._asked_within(here, outside, order, shape)
        child = here.children[0]
        free = self._free(here)
        rest = tuple(v for v in order if v in free and v not in here.variables)
        inner = (*rest, *here.variables)
        own = self._lengths(child, inner)
        name = yield (child, inner, own, True)
        full = tuple(map(len, inner))
        if own != full:
            name = self._register(f"np.broadcast_to({name}, {full})")
        searched = cells(here.variables)
        if rest:
            flat = (*full[: len(rest)], searched)
            name = self._reshaped(name, full, flat)
            total = self._register(f"{name}.dot({self._constant(np.ones(searched))})")
            self.lines.append(f"if not ({total} > TINY).all(): return None")
            result = self._register(f"{name} / {total}[..., None]")
        else:
            flat = (searched,)
            name = self._reshaped(name, full, flat)
            few = searched <= FEW
            total = self._register(
                f"sum({name}.tolist())" if few else f"{name}.dot({self._constant(np.ones(searched))})"
            )
            self.lines.append(f"if not {total} > TINY: return None")
            result = self._register(f"{name} / {total}")
        wanted = tuple(v for v in order if v in free or v in here.variables)
        if wanted != inner:
            result = self._reshaped(result, flat, full)
            result = self._register(f"{result}.transpose({tuple(inner.index(v) for v in wanted)})")
            return self._reshaped(result, tuple(map(len, wanted)), shape)
        return self._reshaped(result, flat, shape)

    def _otherwise(
        self, here: Otherwise, order: tuple[Variable, ...], shape: tuple[int, ...]
    ) -> Generator[tuple[Any, ...], str, str]:
        """The first: where it has no answer nothing has, and the caller computes in logarithms, rule and all."""
        first = here.children[0]
        natural = self._lengths(here, order)
        own = self._lengths(first, order)
        name = yield (first, order, own, False)
        if own != natural:
            name = self._register(f"np.broadcast_to({name}, {natural})")
        return self._reshaped(name, natural, shape)

    def _asked_within(
        self, here: Conditional, own: list[Variable], order: tuple[Variable, ...], shape: tuple[int, ...]
    ) -> str:
        """A question whose searched variables are known around it: normalised first, by a function of its own."""
        known = tuple(v for v in self.known if v not in own)
        inner = _Compiler(known, self.soft, self.sizes, self.names)
        full = (*own, *order)
        lengths = (*map(len, own), *self._lengths(here, order))
        source, run = inner._function("within", climb(inner._emit, here, full, lengths, False))
        self.sources.extend([*inner.sources, source])
        told = [*(self.place[v] for v in known), *self.weights.values()]
        answer = self._register(f"{self._constant(run)}(({''.join(f'{name}, ' for name in told)}))")
        self.lines.append(f"if {answer} is None: return None")
        result = self._register(f"{answer}[{', '.join(self.place[v] for v in own)}]")
        return self._reshaped(result, lengths[len(own) :], shape)

    def _slice(
        self, here: Slice, order: tuple[Variable, ...], shape: tuple[int, ...]
    ) -> Generator[tuple[Any, ...], str, str]:
        child = here.children[0]
        # A known command variable is at this place already: the slice stands in the case for it. And the child may
        # not depend on another one at all: `has` says too often that it does.
        free = self._free(child)
        fixed = {v: place for v, place in here.fixed.items() if v not in self.place and v in free}
        if not fixed:
            return (yield (child, order, shape, False))
        inner = (*fixed, *(v for v in order if v not in fixed))
        own = self._lengths(child, inner)
        name = yield (child, inner, own, False)
        result = self._register(f"{name}[{', '.join(str(place) for place in fixed.values())}]")
        return self._reshaped(result, own[len(fixed) :], shape)
