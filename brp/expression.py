"""What is left of a question after its simplification: sums and products of factors, as a graph without cycles.

Nodes are shared (a part that stands in several branches is one node, and is computed once) and compared by
identity. A graph may be thousands of sums deep, so nothing here or in the modules that walk it recurses on Python's
stack: `climb` runs generators that yield the sub-tasks they need.
"""

from __future__ import annotations

from collections.abc import Callable, Container, Generator, Mapping, Sequence
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
    "Soft",
    "Split",
    "Subroutine",
    "Sum",
    "at",
    "climb",
    "node",
    "postorder",
    "renamed",
]

R = TypeVar("R")

NOTHING: frozenset[Variable] = frozenset()


MANY = 1_000_000
"""Known variables with more values together than this make no table; which they are is then not kept."""

Evidence = frozenset[Variable] | None
"""The known variables that a node depends on; None when they are too many for any table."""


class Node:
    """An array of non-negative numbers over its ``scope``, the variables that are free in it.

    ``evidence`` are the known variables that it depends on as well; they are not in its scope. ``vanishes`` says
    whether it may be zero; ``children`` are what it is made of.
    """

    __slots__ = ("children", "evidence", "scope", "vanishes")

    def __init__(
        self, scope: frozenset[Variable], evidence: Evidence, children: tuple[Node, ...], vanishes: bool
    ) -> None:
        self.scope = scope
        self.evidence = evidence
        self.children = children
        self.vanishes = vanishes

    def has(self, variable: Variable) -> bool:
        """Whether it depends on the variable; for a known one this may be said too often, never too seldom."""
        return variable in self.scope or self.evidence is None or variable in self.evidence


class Leaf(Node):
    """A density, with some of its variables ``fixed`` at a place and those of ``known`` among its evidence."""

    __slots__ = ("density", "fixed", "known")

    def __init__(
        self, density: Density, fixed: Mapping[Variable, int] | None = None, known: frozenset[Variable] = NOTHING
    ) -> None:
        self.density = density
        self.fixed = dict(fixed or {})
        self.known = known
        free = [v for v in density.scope if v not in self.fixed]
        scope = frozenset([v for v in free if v not in known])
        evidence = frozenset([v for v in free if v in known])
        super().__init__(scope, _few(evidence) if len(evidence) > 1 else evidence, (), density.vanishes)


class Soft(Node):
    """What is said of a variable that is known only softly: a weight for each value, told with each evidence."""

    __slots__ = ("variable",)

    def __init__(self, variable: Variable) -> None:
        self.variable = variable
        # As if it depended on a known variable with too many values for a table, which is what the weights are.
        weights = frozenset((Variable(f"soft-{variable.name}", range(MANY)),))
        super().__init__(frozenset((variable,)), weights, (), True)


class Product(Node):
    """The product of its children; 1 when there are none."""

    __slots__ = ()

    def __init__(self, children: tuple[Node, ...]) -> None:
        scope = NOTHING.union(*[c.scope for c in children])
        super().__init__(scope, _together(children), children, any(c.vanishes for c in children))


class Sum(Node):
    """The sum of its one child over ``variables``."""

    __slots__ = ("variables",)

    def __init__(self, variables: tuple[Variable, ...], child: Node) -> None:
        self.variables = variables
        super().__init__(child.scope.difference(variables), child.evidence, (child,), child.vanishes)


class Split(Node):
    """Another child for each value of ``variable``, in the order of its values; ``known`` says that it is known."""

    __slots__ = ("known", "variable")

    def __init__(self, variable: Variable, branches: tuple[Node, ...], known: bool = False) -> None:
        self.variable = variable
        self.known = known
        scope = NOTHING.union(*[branch.scope for branch in branches])
        evidence = _together(branches)
        if not known:
            scope = scope.union((variable,))
        elif evidence is not None:
            evidence = _few(evidence.union((variable,)))
        super().__init__(scope, evidence, branches, any(branch.vanishes for branch in branches))


class Conditional(Node):
    """Its one child divided by its sum over ``variables``: 1/Sigma, for each value of the rest of the scope.

    ``name`` is the question's own, for refusals where the sum is zero. Those of ``variables`` that are in ``known``
    are known around it; in the child they are free.
    """

    __slots__ = ("name", "variables")

    def __init__(
        self, variables: tuple[Variable, ...], child: Node, name: str, known: frozenset[Variable] = NOTHING
    ) -> None:
        self.variables = variables
        self.name = name
        scope, evidence = child.scope.union(variables), child.evidence
        outside = known.intersection(variables)
        if outside:
            scope = scope.difference(outside)
            evidence = None if evidence is None else _few(evidence.union(outside))
        super().__init__(scope, evidence, (child,), child.vanishes)


class Otherwise(Node):
    """Its first child, a question, and its second where the first has no answer: where what it knows is impossible.

    Both are normalised over ``variables``.
    """

    __slots__ = ("variables",)

    def __init__(self, variables: tuple[Variable, ...], first: Node, second: Node) -> None:
        self.variables = variables
        both = (first, second)
        super().__init__(first.scope | second.scope, _together(both), both, first.vanishes or second.vanishes)


class Slice(Node):
    """Its one child at a fixed place of some variables."""

    __slots__ = ("fixed",)

    def __init__(self, child: Node, fixed: Mapping[Variable, int]) -> None:
        self.fixed = dict(fixed)
        evidence = None if child.evidence is None else child.evidence.difference(fixed)
        super().__init__(child.scope.difference(fixed), evidence, (child,), child.vanishes)

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


def _few(evidence: frozenset[Variable]) -> Evidence:
    return evidence if cells(evidence) <= MANY else None


def _together(nodes: Sequence[Node]) -> Evidence:
    """The evidence of all, or None."""
    union = NOTHING
    for n in nodes:
        if n.evidence is None:
            return None
        union = union | n.evidence if union else n.evidence
        # Checked as it grows: a union of thousands is never made.
        if len(union) > 1 and cells(union) > MANY:
            return None
    return union


def node(factor: Factor, known: frozenset[Variable] = NOTHING) -> Node:
    """A factor as a node where ``known`` are known; a flat one is a table of equal logarithms here."""
    if isinstance(factor, Density):
        return Leaf(factor, None, known)
    if isinstance(factor, Cases):
        # Values that share a form share its node.
        made = {id(branch): node(branch, known) for branch in factor.branches}
        return Split(factor.variable, tuple(made[id(b)] for b in factor.branches), factor.variable in known)
    if isinstance(factor, Subroutine):
        inside = factor.start.children[0]
        start = inside if factor.opened is not None and isinstance(inside, Leaf | Split) else factor.start
        return renamed(start, {}, known)
    logs = np.full(tuple(map(len, factor.of)), -np.log(cells(factor.of)))
    return Leaf(Density(factor.of, (), factor.names, lambda *places: logs[places], vanishes=False), None, known)


def at(start: Node, variable: Variable, place: int) -> Node:
    """``start`` with ``variable`` fixed at ``place``; the same node when it does not depend on it."""
    if not start.has(variable):
        return start
    if isinstance(start, Leaf):
        fits = variable in start.density.scope and variable not in start.fixed
        return Leaf(start.density, start.fixed | {variable: place}, start.known) if fits else start
    if isinstance(start, Split):
        if start.variable == variable:
            return start.children[place]
        return Split(start.variable, tuple(at(branch, variable, place) for branch in start.children), start.known)
    if isinstance(start, Product):
        return Product(tuple(at(child, variable, place) for child in start.children))
    if isinstance(start, Slice):
        return Slice(start.children[0], start.fixed | {variable: place})
    if isinstance(start, Soft) and start.variable != variable:
        return start
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


def postorder(start: Node, seen: Container[int] = ()) -> list[Node]:
    """Every node once, children before parents; without those (and what is below them) whose id is in ``seen``."""
    order: list[Node] = []
    met: set[int] = set()
    stack: list[tuple[Node, bool]] = [(start, False)]
    while stack:
        here, done = stack.pop()
        if done:
            order.append(here)
        elif id(here) not in met and id(here) not in seen:
            met.add(id(here))
            stack.append((here, True))
            stack.extend([(child, False) for child in reversed(here.children)])
    return order


def renamed(start: Node, new: Mapping[Variable, Variable], known: frozenset[Variable] = NOTHING) -> Node:
    """The same expression over other variables, bound ones included, where ``known`` (new ones) are known.

    Shared nodes stay shared.
    """
    made: dict[tuple[int, frozenset[Variable]], Node] = {}

    def task(here: Node, known: frozenset[Variable]) -> Generator[tuple[Any, ...], Node, Node]:
        key = (id(here), known)
        if key in made:
            return made[key]
        variables = tuple([new.get(v, v) for v in getattr(here, "variables", ())])
        within = known.difference(variables) if isinstance(here, Conditional) else known
        children = []
        for child in here.children:
            children.append((yield (child, within)))
        result: Node
        match here:
            case Leaf():
                fixed = {new.get(v, v): place for v, place in here.fixed.items()}
                density = here.density
                if any(v in new for v in density.scope):
                    density = densities.setdefault(density, density.renamed(new))
                result = Leaf(density, fixed, known)
            case Sum():
                result = Sum(variables, children[0])
            case Split():
                variable = new.get(here.variable, here.variable)
                result = Split(variable, tuple(children), variable in known)
            case Conditional():
                result = Conditional(variables, children[0], here.name, known)
            case Otherwise():
                result = Otherwise(variables, children[0], children[1])
            case Slice():
                result = Slice(children[0], {new.get(v, v): place for v, place in here.fixed.items()})
            case _:
                result = Product(tuple(children))
        made[key] = result
        return result

    densities: dict[Density, Density] = {}
    return climb(task, start, known)
