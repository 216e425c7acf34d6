"""The numeric phase of section 3.4: a simplified question as straight-line numpy, compiled once, asked many times.

The compiled function works with probabilities, not with logarithms: sums are then products of matrices. Two things
keep it right where probabilities get small. Every few sums the numbers are scaled up again, and a total below
`brp.source.TINY` is not trusted: the function returns None, and the caller computes in logarithms (`brp.logs`).
Whatever underflowed on the way to a total above it was smaller than the total by more than 50 powers of ten.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brp.contraction import components, layout
from brp.expression import Conditional, Leaf, Node, Otherwise, Product, Slice, Soft, Split, Sum, climb, postorder
from brp.logs import logarithms
from brp.products import Axes, Emission, Products, Shape
from brp.source import FEW, Run, looked_up
from brp.tables import Sizes
from brp.variables import Variable, cells

__all__ = ["Compiled", "Compiler", "compiled", "do", "probabilities"]

SUMS = 8
"""How many sums may follow one another before their result is scaled up."""

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Compiled:
    """A function from what is told (places, or values by keyword) to probabilities, or to None, and its source."""

    run: Run
    source: str


def probabilities(start: Node, order: Sequence[Variable]) -> Array:
    """All of ``start`` as an array with an axis for each of ``order``; nan where a question has no answer."""
    shape = tuple(map(len, order))
    quick = compiled(start, (), tuple(order)).run(())
    values = quick if quick is not None else np.exp(logarithms(start, order))
    return np.ascontiguousarray(np.broadcast_to(values, shape))


def compiled(
    start: Node,
    known: Axes,
    order: Axes,
    sizes: Sizes | None = None,
    soft: Axes = (),
    keywords: bool = False,
) -> Compiled:
    """Compile ``start``: known values in, an array with an axis for each of ``order`` out.

    An axis of a variable that ``start`` does not depend on has length 1. What is told when it runs are the places
    of ``known``, then the weights of ``soft``; with ``keywords`` a mapping from the keyword of each of them to its
    value, or to what `weigh` takes. A mapping that does not fit raises `KeyError`, `TypeError` or `EvidenceError`.
    """
    return Compiler(known, soft, sizes or Sizes(start)).compile(start, order, keywords)


class Compiler(Products):
    """Turns an expression into lines of source over named arrays."""

    def compile(self, start: Node, order: Axes, keywords: bool) -> Compiled:
        """The function, and its text."""
        self.root = start
        while isinstance(self.root, Otherwise):
            self.root = self.root.children[0]
        result = climb(do, self._emit, start, order, self._lengths(start, order), False)
        lookup = looked_up(self.source, self.place, self.weights) if keywords else []
        text, run = self.source.function("ask", result, lookup)
        return Compiled(run, "\n\n".join([*self.source.functions, text]))

    def _everything(self, here: Node, order: Axes) -> Array:
        return probabilities(here, order)

    def _emit(self, here: Node, order: Axes, shape: Shape, scale: bool) -> Emission:
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

    # Sums.

    def _sum(self, here: Sum, order: Axes, shape: Shape, scale: bool) -> Emission:
        child = here.children[0]
        if isinstance(child, Split) and child.variable in here.variables:
            return (yield from self._cases(here, child, order, shape))
        result = yield from self._contract(child, here.variables, order, shape, scale)
        depth = self.depth.get(result, 0) + 1
        if scale and depth >= SUMS:
            largest = self.source.register(f"{result}.max()")
            self.source.guard(f"{largest} > TINY")
            result = self.source.register(f"{result} / {largest}")
            depth = 0
        self.depth[result] = depth
        return result

    def _contract(self, child: Node, variables: Axes, order: Axes, shape: Shape, scale: bool) -> Emission:
        """The sum of a product over ``variables``: a product of matrices wherever that is possible."""
        members = self._members(child)
        summed = tuple([v for v in variables if v in child.scope])
        plan = layout(members, summed, order, self._free) if len(summed) == len(variables) else None
        if plan is None:
            # One factor alone, or sums that the two sides do not share.
            absent = cells([v for v in variables if v not in child.scope])
            inner = (*order, *summed)
            lengths = tuple(self._length(members, v) for v in inner)
            product = yield from self._product(members, inner, lengths, scale)
            axes = tuple(range(len(order), len(inner)))
            total = f"{product}.sum({axes})" if axes else product
            result = self.source.register(f"{total} * {absent}" if absent != 1 else total)
            self.depth[result] = self.depth.get(product, 0)
            return self._reshaped(result, lengths[: len(order)], shape)
        left = yield from self._product(plan.left, (*plan.both, *plan.rows, *plan.shared), plan.left_shape, scale)
        right_axes = (*plan.both, *plan.shared, *plan.columns)
        right = yield (self._emit, plan.right, right_axes, plan.right_shape, scale)
        result = self.source.register(f"np.matmul({left}, {right})" if plan.both else f"{left}.dot({right})")
        self.depth[result] = max(self.depth.get(left, 0), self.depth.get(right, 0))
        now = (*plan.both, *plan.rows, *plan.columns)
        return self._turned(result, now, plan.shape, tuple(v for v in order if v in now), shape)

    # Cases.

    def _cases(self, here: Sum, split: Split, order: Axes, shape: Shape) -> Emission:
        """The sum over a command variable: of the products that its cases are."""
        rest = tuple(v for v in here.variables if v != split.variable)
        branches = [self._keep(Sum(rest, branch)) if rest else branch for branch in split.children]
        natural = self._lengths(here, order)
        parts = components([self._free(member) for branch in branches for member in self._members(branch)])
        if len(parts) < 2:
            names = []
            for branch in branches:
                own = self._lengths(branch, order)
                names.append((yield from self._product(self._members(branch), order, own, False)))
            return self._reshaped(self.source.register(" + ".join(names)), natural, shape)
        # Each case is a weight times a row over one part of the variables times a row over the others: all cases
        # together are one product of matrices. A case that weighs nothing is not computed.
        broad = max(parts, key=cells)
        first = tuple(v for v in order if v in broad)
        second = tuple(v for v in order if v not in broad and v in self._free(here))
        sides = []
        for axes in (first, second):
            sides.append(self.source.variable(f"np.zeros({(len(branches), *map(len, axes))})"))
        alone = self._nothing_shared(branches)
        for number, branch in enumerate(branches):
            members = self._members(branch)
            weights = []
            for member in members:
                if not self._free(member):
                    weights.append((yield (self._number, member)))
            of = [[m for m in members if self._free(m) and self._free(m) <= set(axes)] for axes in (first, second)]
            if weights and alone:
                weight = self.source.register(" * ".join(weights)) if len(weights) > 1 else weights[0]
                before = dict(self.made), dict(self.lists)
                with self.source.block(f"if {weight}:"):
                    yield from self._row(sides[0], number, of[0], first, [])
                    yield from self._row(sides[1], number, of[1], second, [weight])
                self.made, self.lists = before
            else:
                yield from self._row(sides[0], number, of[0], first, [])
                yield from self._row(sides[1], number, of[1], second, weights)
        flat = cells(first), cells(second)
        left = self._reshaped(sides[0], (len(branches), *map(len, first)), (len(branches), flat[0]))
        right = self._reshaped(sides[1], (len(branches), *map(len, second)), (len(branches), flat[1]))
        result = self.source.register(f"{left}.T.dot({right})")
        now = (*first, *second)
        return self._turned(result, now, flat, tuple(v for v in order if v in now), shape)

    def _row(self, side: str, number: int, members: Sequence[Node], axes: Axes, weights: Sequence[str]) -> Emission:
        """One case's row of one side."""
        row = ""
        if members:
            own = tuple(self._length(members, v) for v in axes)
            row = yield from self._product(members, axes, own, False)
        self.source.line(f"{side}[{number}] = {' * '.join([*weights, *([row] if row else [])]) or '1.0'}")
        return row

    def _nothing_shared(self, branches: Sequence[Node]) -> bool:
        """Whether no case computes, its weight aside, what another one computes as well."""
        met: set[int] = set()
        for branch in branches:
            inside = {
                id(n)
                for member in self._members(branch)
                if self._free(member)
                for n in postorder(member)
                if isinstance(n, Sum | Conditional | Otherwise) and not self._folds(n)
            }
            if met & inside:
                return False
            met |= inside
        return True

    def _split(self, here: Split, order: Axes, shape: Shape, scale: bool) -> Emission:
        if here.variable in self.place:
            return self._choice(here, order, shape, scale)
        # The command variable is searched, or summed further out: the cases side by side.
        lengths = self._lengths(here, order)
        axis = order.index(here.variable)
        result = self.source.variable(f"np.empty({lengths})")
        for number, branch in enumerate(here.children):
            own = self._lengths(branch, order)
            name = yield (self._emit, branch, order, own, False)
            at = ", ".join([*(":" for _ in range(axis)), f"{number}:{number + 1}"])
            self.source.line(f"{result}[{at}] = {name}")
        return self._reshaped(result, lengths, shape)

    def _choice(self, here: Split, order: Axes, shape: Shape, scale: bool) -> str:
        """The lines of each case of a known command variable under a condition on its place."""
        natural = self._lengths(here, order)
        result = f"r{self.source.registers}"
        made: dict[int, list[str]] = {}
        runs: list[tuple[int, list[str]]] = []
        registers = self.source.registers = self.source.registers + 1
        for number, branch in enumerate(here.children):
            if id(branch) not in made:
                inner = Compiler(self.known, self.soft, self.sizes, self)
                inner.source.registers = registers
                own = self._lengths(branch, order)
                name = climb(do, inner._emit, branch, order, own, scale)
                if own != natural:
                    name = inner.source.register(f"np.broadcast_to({name}, {natural})")
                inner.source.line(f"{result} = {name}")
                made[id(branch)] = inner.source.lines
                self.source.registers = max(self.source.registers, inner.source.registers)
            if not runs or runs[-1][1] != made[id(branch)]:
                runs.append((number, made[id(branch)]))
        self.source.choose(self.place[here.variable], runs)
        return self._reshaped(result, natural, shape)

    # Questions within.

    def _conditional(self, here: Conditional, order: Axes, shape: Shape) -> Emission:
        outside = [v for v in here.variables if v in self.place]
        if outside:
            return self._asked_within(here, outside, order, shape)
        child = here.children[0]
        free = self._free(here)
        rest = tuple(v for v in order if v in free and v not in here.variables)
        if not rest:
            parts = self._independent(here)
            if parts:
                result = yield from self._product(parts, order, shape, False)
                for part in parts:  # what divides knows what has no answer; a table only has it written down
                    name = self.made[id(part), order, self._lengths(part, order), False]
                    if name in self.gaps:
                        self.source.guard(f"{name}.item(0) >= 0")
                return result
        inner = (*rest, *here.variables)
        own = self._lengths(child, inner)
        name = yield (self._emit, child, inner, own, True)
        full = tuple(map(len, inner))
        if own != full:
            name = self.source.register(f"np.broadcast_to({name}, {full})")
        searched = cells(here.variables)
        if rest:
            flat = (*full[: len(rest)], searched)
            name = self._reshaped(name, full, flat)
            total = self.source.register(f"{name}.dot({self.source.array(np.ones(searched))})")
            self.source.guard(f"({total} > TINY).all()")
            result = self.source.register(f"{name} / {total}[..., None]")
        elif name in self.distributions:
            flat, result = full, name
        else:
            flat = (searched,)
            name = self._reshaped(name, full, flat)
            few = searched <= FEW
            ones = "" if few else self.source.array(np.ones(searched))
            total = self.source.register(f"sum({name}.tolist())" if few else f"{name}.dot({ones})")
            self.source.guard(f"{total} > TINY")
            result = self.source.register(f"{name} / {total}")
        return self._turned(result, inner, flat, tuple(v for v in order if v in free or v in here.variables), shape)

    def _independent(self, here: Conditional) -> list[Node]:
        """The questions that it falls into, where its product does: each is divided by a smaller sum of its own."""
        members = self._members(here.children[0])
        parts = components([self._free(member) for member in members])
        if len(parts) < 2 or frozenset().union(*parts) != frozenset(here.variables):
            return []
        questions: list[Node] = []
        for number, part in enumerate(parts):
            variables = tuple(v for v in here.variables if v in part)
            # What has no free variable counts once.
            inside = tuple(m for m in members if self._free(m) and self._free(m) <= part)
            inside += tuple(m for m in members if not self._free(m)) if not number else ()
            if (
                len(inside) == 1
                and isinstance(inside[0], Conditional)
                and set(inside[0].variables) == set(variables)
            ):
                questions.append(inside[0])
            else:
                child = inside[0] if len(inside) == 1 else self._keep(Product(inside))
                questions.append(self._keep(Conditional(variables, child, here.name)))
        return questions

    def _otherwise(self, here: Otherwise, order: Axes, shape: Shape) -> Emission:
        """The first: where it has no answer nothing has, and the caller computes in logarithms, rule and all."""
        first = here.children[0]
        natural = self._lengths(here, order)
        own = self._lengths(first, order)
        name = yield (self._emit, first, order, own, False)
        if own != natural:
            name = self.source.register(f"np.broadcast_to({name}, {natural})")
        return self._reshaped(name, natural, shape)

    def _asked_within(self, here: Conditional, own: list[Variable], order: Axes, shape: Shape) -> str:
        """A question whose searched variables are known around it: normalised first, by a function of its own."""
        known = tuple(v for v in self.known if v not in own)
        inner = Compiler(known, self.soft, self.sizes, self)
        full = (*own, *order)
        lengths = (*map(len, own), *self._lengths(here, order))
        result = climb(do, inner._emit, here, full, lengths, False)
        text, run = inner.source.function("within", result)
        self.source.functions.append(text)
        told = [*(self.place[v] for v in known), *self.weights.values()]
        answer = self.source.register(f"{self.source.constant(run)}(({''.join(f'{name}, ' for name in told)}))")
        self.source.line(f"if {answer} is None: return None")
        result = self.source.register(f"{answer}[{', '.join(self.place[v] for v in own)}]")
        return self._reshaped(result, lengths[len(own) :], shape)

    def _slice(self, here: Slice, order: Axes, shape: Shape) -> Emission:
        child = here.children[0]
        # A known command variable is at this place already: the slice stands in the case for it. And the child may
        # not depend on another one at all: `has` says too often that it does.
        free = self._free(child)
        fixed = {v: place for v, place in here.fixed.items() if v not in self.place and v in free}
        if not fixed:
            return (yield (self._emit, child, order, shape, False))
        inner = (*fixed, *(v for v in order if v not in fixed))
        own = self._lengths(child, inner)
        name = yield (self._emit, child, inner, own, False)
        result = self.source.register(f"{name}[{', '.join(str(place) for place in fixed.values())}]")
        return self._reshaped(result, own[len(fixed) :], shape)


def do(task: Callable[..., Emission], *arguments: Any) -> Emission:
    """`climb` runs tasks of several kinds."""
    return task(*arguments)
