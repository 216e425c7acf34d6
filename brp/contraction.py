"""A sum of a product as one product of matrices: which factor is which side, and in which order their axes go."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from brp.expression import Node
from brp.variables import Variable, cells

__all__ = ["Layout", "components", "layout"]

Free = Callable[[Node], frozenset[Variable]]
Axes = tuple[Variable, ...]


@dataclass(frozen=True)
class Layout:
    """``left`` factors, multiplied, have the axes (both, rows, shared); ``right`` has (both, shared, columns).

    Their product of matrices has the axes (both, rows, columns), and sums over ``shared``.
    """

    left: tuple[Node, ...]
    right: Node
    both: Axes
    rows: Axes
    columns: Axes
    shared: Axes

    @property
    def left_shape(self) -> tuple[int, ...]:
        """The matrices at the left: no axis for rows that there are none of, unless each has a batch of its own."""
        m, s = cells(self.rows), cells(self.shared)
        return (cells(self.both), m, s) if self.both else (m, s) if self.rows else (s,)

    @property
    def right_shape(self) -> tuple[int, ...]:
        """The matrices at the right, likewise."""
        n, s = cells(self.columns), cells(self.shared)
        return (cells(self.both), s, n) if self.both else (s, n) if self.columns else (s,)

    @property
    def shape(self) -> tuple[int, ...]:
        """What comes of them."""
        m, n = cells(self.rows), cells(self.columns)
        if self.both:
            return cells(self.both), m, n
        return (*((m,) if self.rows else ()), *((n,) if self.columns else ()))


def layout(members: Sequence[Node], summed: Axes, order: Axes, free: Free) -> Layout | None:
    """The cheapest layout for the sum over ``summed`` of the members' product; None where there is none.

    ``order`` has all variables that are left. One member is the right side, the product of all others the left:
    since that is taken number by number, the smallest such product is best, and of equal ones the larger right.
    """
    if len(members) < 2:
        return None
    scopes = [free(member) for member in members]
    best: tuple[int, int, int] | None = None
    for number, heavy in enumerate(scopes):
        light = frozenset().union(*[scope for other, scope in enumerate(scopes) if other != number])
        if all(v in heavy and v in light for v in summed):
            cost = cells(light) if len(members) > 2 else 0
            best = min(best or (cost + 1, 0, 0), (cost, -cells(heavy), number))
    if best is None:
        return None
    chosen = best[2]
    heavy = scopes[chosen]
    light = frozenset().union(*[scope for other, scope in enumerate(scopes) if other != chosen])
    return Layout(
        tuple([member for number, member in enumerate(members) if number != chosen]),
        members[chosen],
        tuple([v for v in order if v in light and v in heavy]),
        tuple([v for v in order if v in light and v not in heavy]),
        tuple([v for v in order if v in heavy and v not in light]),
        summed,
    )


def components(scopes: Sequence[frozenset[Variable]]) -> list[frozenset[Variable]]:
    """The variables of all scopes, those together that some scope joins, by first appearance."""
    parts: list[frozenset[Variable]] = []
    for scope in scopes:
        if scope:
            joined = [part for part in parts if part & scope]
            merged = scope.union(*joined)
            first = min((parts.index(part) for part in joined), default=len(parts))
            parts = [part for part in parts if not part & scope]
            parts.insert(first, merged)
    return parts
