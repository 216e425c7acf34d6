"""What is left of a question after its simplification: sums and products of factors, as a graph without cycles.

Nodes are shared (a part that stands in several branches is one node, and is computed once) and compared by
identity. A graph may be thousands of sums deep, so nothing here or in the modules that walk it recurses on Python's
stack: `climb` runs generators that yield the sub-tasks they need.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Mapping
from typing import Any, TypeVar

import numpy as np

from brp.factors import Cases, Density, Factor
from brp.variables import Variable, cells

__all__ = [
    "Conditional",
    "Leaf",
    "Node",
    "Otherwise",
    "Product",
    "Slice",
    "Split",
    "Subroutine",
    "Sum",
    "at",
    "climb",
]
__all__ += ["node", "postorder", "renamed"]

R = TypeVar("R")


class Node:
    """An array of non-negative numbers over its ``scope``, the variables that are still free in it.

    ``vanishes`` says whether it may be zero; ``children`` are what it is made of.
    """

    __slots__ = ("children", "scope", "vanishes")

    def __init__(self, scope: frozenset[Variable], children: tuple[Node, ...], vanishes: bool) -> None:
        self.scope = scope
        self.children = children
        self.vanishes = vanishes


class Leaf(Node):
    """A density, with some of its variables ``fixed`` at a place."""

    __slots__ = ("density", "fixed")

    def __init__(self, density: Density, fixed: Mapping[Variable, int] | None = None) -> None:
        self.density = density
        self.fixed = dict(fixed or {})
        super().__init__(frozenset(density.scope).difference(self.fixed), (), density.vanishes)


class Product(Node):
    """The product of its children; 1 when there are none."""

    __slots__ = ()

    def __init__(self, children: tuple[Node, ...]) -> None:
        super().__init__(
            frozenset().union(*(c.scope for c in children)), children, any(c.vanishes for c in children)
        )


class Sum(Node):
    """The sum of its one child over ``variables``."""

    __slots__ = ("variables",)

    def __init__(self, variables: tuple[Variable, ...], child: Node) -> None:
        self.variables = variables
        super().__init__(child.scope.difference(variables), (child,), child.vanishes)


class Split(Node):
    """Another child for each value of ``variable``, in the order of its values."""

    __slots__ = ("variable",)

    def __init__(self, variable: Variable, branches: tuple[Node, ...]) -> None:
        self.variable = variable
        scope = frozenset((variable,)).union(*(branch.scope for branch in branches))
        super().__init__(scope, branches, any(branch.vanishes for branch in branches))


class Conditional(Node):
    """Its one child divided by its sum over ``variables``: 1/Sigma, for each value of the rest of the scope.

    ``name`` is the question's own, for refusals where the sum is zero.
    """

    __slots__ = ("name", "variables")

    def __init__(self, variables: tuple[Variable, ...], child: Node, name: str) -> None:
        self.variables = variables
        self.name = name
        super().__init__(child.scope.union(variables), (child,), child.vanishes)


class Otherwise(Node):
    """Its first child, a question, and its second where the first has no answer: where what it knows is impossible.

    Both are normalised over ``variables``.
    """

    __slots__ = ("variables",)

    def __init__(self, variables: tuple[Variable, ...], first: Node, second: Node) -> None:
        self.variables = variables
        scope = first.scope.union(second.scope, variables)
        super().__init__(scope, (first, second), first.vanishes or second.vanishes)


class Slice(Node):
    """Its one child at a fixed place of some variables."""

    __slots__ = ("fixed",)

    def __init__(self, child: Node, fixed: Mapping[Variable, int]) -> None:
        self.fixed = dict(fixed)
        super().__init__(child.scope.difference(fixed), (child,), child.vanishes)

    def at(self, variable: Variable, place: int) -> Node:
        """The child at one more place."""
        return Slice(self.children[0], self.fixed | {variable: place})


class Subroutine(Factor):
    """A question as a factor: P(Searched | Known) of another description, normalised for every known value.

    ``start`` is its simplified expression. When that needs no division (the question only sums out of a product
    that is normalised already) ``opened`` holds the product's factors, to be simplified together with those around
    it, and ``hidden`` the variables that it sums out: opening changes nothing then, and only then.
    """

    def __init__(
        self,
        of: tuple[Variable, ...],
        given: tuple[Variable, ...],
        names: tuple[str, ...],
        start: Node,
        opened: tuple[Factor, ...] | None,
        hidden: tuple[Variable, ...],
    ) -> None:
        super().__init__(of, given, names)
        self.start = start
        self.opened = opened
        self.hidden = hidden
        self.vanishes = start.vanishes

    def renamed(self, new: Mapping[Variable, Variable]) -> Subroutine:
        """The same question over other variables."""
        return Subroutine(
            tuple(new.get(v, v) for v in self.of),
            tuple(new.get(v, v) for v in self.given),
            self.names,
            renamed(self.start, new),
            None if self.opened is None else tuple(factor.renamed(new) for factor in self.opened),
            tuple(new.get(v, v) for v in self.hidden),
        )


def node(factor: Factor) -> Node:
    """A factor as a node; a flat one is a table of equal logarithms here."""
    if isinstance(factor, Density):
        return Leaf(factor)
    if isinstance(factor, Cases):
        # Values that share a form share its node.
        made = {id(branch): node(branch) for branch in factor.branches}
        return Split(factor.variable, tuple(made[id(branch)] for branch in factor.branches))
    if isinstance(factor, Subroutine):
        inside = factor.start.children[0]
        return inside if factor.opened is not None and isinstance(inside, Leaf | Split) else factor.start
    logs = np.full(tuple(map(len, factor.of)), -np.log(cells(factor.of)))
    return Leaf(Density(factor.of, (), factor.names, lambda *places: logs[places], vanishes=False))


def at(start: Node, variable: Variable, place: int) -> Node:
    """``start`` with ``variable`` fixed at ``place``; the same node when it does not depend on it."""
    if variable not in start.scope:
        return start
    if isinstance(start, Leaf):
        return Leaf(start.density, start.fixed | {variable: place})
    if isinstance(start, Split):
        if start.variable == variable:
            return start.children[place]
        return Split(start.variable, tuple(at(branch, variable, place) for branch in start.children))
    if isinstance(start, Product):
        return Product(tuple(at(child, variable, place) for child in start.children))
    if isinstance(start, Slice):
        return Slice(start.children[0], start.fixed | {variable: place})
    return Slice(start, {variable: place})


def climb(task: Callable[..., Generator[tuple[Any, ...], Any, R]], *arguments: Any) -> R:
    """Run ``task(*arguments)``, a generator that yields the arguments of the sub-tasks whose results it needs."""
    stack = [task(*arguments)]
    result: Any = None
    while stack:
        try:
            wanted = stack[-1].send(result)
        except StopIteration as done:
            stack.pop()
            result = done.value
        else:
            stack.append(task(*wanted))
            result = None
    answer: R = result
    return answer


def postorder(start: Node) -> list[Node]:
    """Every node once, children before parents."""
    order: list[Node] = []
    seen: set[int] = set()
    stack: list[tuple[Node, bool]] = [(start, False)]
    while stack:
        here, done = stack.pop()
        if done:
            order.append(here)
        elif id(here) not in seen:
            seen.add(id(here))
            stack.append((here, True))
            stack.extend((child, False) for child in reversed(here.children))
    return order


def renamed(start: Node, new: Mapping[Variable, Variable]) -> Node:
    """The same expression over other variables, bound ones included; shared nodes stay shared."""
    made: dict[int, Node] = {}
    for here in postorder(start):
        children = tuple(made[id(child)] for child in here.children)
        result: Node
        match here:
            case Leaf():
                fixed = {new.get(v, v): place for v, place in here.fixed.items()}
                result = Leaf(here.density.renamed(new), fixed)
            case Sum():
                result = Sum(tuple(new.get(v, v) for v in here.variables), children[0])
            case Split():
                result = Split(new.get(here.variable, here.variable), children)
            case Conditional():
                result = Conditional(tuple(new.get(v, v) for v in here.variables), children[0], here.name)
            case Otherwise():
                result = Otherwise(tuple(new.get(v, v) for v in here.variables), *children)
            case Slice():
                result = Slice(children[0], {new.get(v, v): place for v, place in here.fixed.items()})
            case _:
                result = Product(children)
        made[id(here)] = result
    return made[id(start)]
