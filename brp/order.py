"""In which order unknown variables are summed out: greedily, and where that is dear, by a search within a budget.

What an order costs is estimated as the compiled plan will spend it (`brp.contraction`): one multiplication for each
number of the product that is summed, more where a product cannot be left to a product of matrices.
"""

from __future__ import annotations

import heapq
from collections.abc import Callable, Iterable, Sequence
from math import inf

from brp.variables import Variable, cells

__all__ = ["best_order", "together"]

DEAR = 1_000_000
"""Below so many multiplications the greedy order is good enough."""
SHARE = 1000
"""One bucket may be weighed in the search for so many multiplications of the greedy order ..."""
BUDGET = 20_000
"""... and no more than so many in all."""
DEEP = 60
"""With more variables than this only greedy orders are tried."""
PLAIN = 2, 8
"""A number of a product that numpy multiplies one by one costs as much as so many within a product of matrices:
while the product stays in the processor's cache, and where it does not."""
CACHED = 30_000
"""So many numbers do."""
MOVED = 2
"""The same for a number that is put elsewhere, or summed by itself."""

Tie = Callable[[int, int], int]
"""Among equals the smallest: of a variable's number, and the variables (as bits) of what was made last."""

TIES: tuple[Tie, ...] = (
    lambda variable, last: -(last >> variable & 1),
    lambda variable, last: -variable,
)


def best_order(scopes: Sequence[Iterable[Variable]], unknown: Sequence[Variable]) -> tuple[Variable, ...]:
    """The order in which to sum the product of factors over ``scopes`` over all of ``unknown``.

    The same question always gets the same order. Ties go to the variable that stands first in ``unknown``.
    """
    greedy = _smallest_next(scopes, unknown)
    if len(unknown) < 3 or greedy[1] < DEAR:
        return greedy[0]
    search = _Search([frozenset(scope) for scope in scopes], unknown, min(BUDGET, int(greedy[1]) // SHARE))
    search.try_order([search.number[v] for v in greedy[0]])
    for tie in TIES:
        search.greedily(tie)
    if len(unknown) <= DEEP:
        search.exhaustively()
    return tuple(unknown[k] for k in search.best)


def together(
    first: Sequence[frozenset[Variable]],
    second: Sequence[frozenset[Variable]],
    made: frozenset[Variable],
    result: frozenset[Variable],
) -> bool:
    """Whether two sums are better done as one: the factors of the first, then its sum ``made`` with the second."""

    def cost(scopes: Sequence[frozenset[Variable]], result: frozenset[Variable]) -> float:
        sides = [
            cells(frozenset().union(*[scope for other, scope in enumerate(scopes) if other != heavy]))
            for heavy in range(len(scopes))
        ]
        return _spent(cells(frozenset().union(*scopes)), cells(result), [*map(cells, scopes)], sides)

    return cost([*first, *second], result) <= cost(first, made) + cost([made, *second], result)


def _spent(product: float, result: float, factors: Sequence[float], sides: Sequence[float]) -> float:
    """What one sum costs, from the sizes of its product, its result, each factor, and all factors but that one."""
    moved = result + sum(factors)
    if len(factors) == 1:
        return product + MOVED * (moved + product)
    plain = min(sides) if len(factors) > 2 else 0
    return product + MOVED * moved + PLAIN[plain > CACHED] * plain


def _smallest_next(
    scopes: Sequence[Iterable[Variable]], unknown: Sequence[Variable]
) -> tuple[tuple[Variable, ...], float]:
    """Each time the variable whose product is smallest; and the multiplications that this makes."""
    pool: dict[int, frozenset[Variable]] = {k: frozenset(scope) for k, scope in enumerate(scopes)}
    users: dict[Variable, set[int]] = {v: set() for v in unknown}
    for k, scope in pool.items():
        for v in users.keys() & scope:
            users[v].add(k)
    rank = {v: number for number, v in enumerate(unknown)}
    size: dict[Variable, int] = {}

    def weigh(variable: Variable) -> int:
        size[variable] = cells(frozenset().union(*[pool[k] for k in users[variable]]))
        return size[variable]

    heap = [(weigh(v), rank[v], v) for v in unknown]
    heapq.heapify(heap)
    order: list[Variable] = []
    total, number = 0, len(pool)
    while heap:
        weight, _, variable = heapq.heappop(heap)
        if variable not in users or weight != size[variable]:
            continue
        bucket = users.pop(variable)
        made = frozenset().union(*[pool.pop(k) for k in bucket]).difference((variable,))
        order.append(variable)
        total += weight
        pool[number] = made
        near = [v for v in made if v in users]
        for v in near:
            users[v].difference_update(bucket)
            users[v].add(number)
        for v in near:
            heapq.heappush(heap, (weigh(v), rank[v], v))
        number += 1
    return tuple(order), total


class _Search:
    """Orders and what they cost; scopes are integers here, a bit for each variable."""

    def __init__(self, scopes: Sequence[frozenset[Variable]], unknown: Sequence[Variable], budget: int) -> None:
        everything = dict.fromkeys([*unknown, *(v for scope in scopes for v in sorted(scope, key=str))])
        self.number = {v: number for number, v in enumerate(everything)}
        self.lengths = [len(v) for v in everything]
        self.scopes = tuple(sum(1 << self.number[v] for v in scope) for scope in scopes)
        self.unknown = range(len(unknown))
        self.budget = budget
        self.best: tuple[int, ...] = ()
        self.cost = inf
        self._cells: dict[int, float] = {0: 1.0}

    def cells(self, scope: int) -> float:
        """How many values the conjunction of the variables has."""
        if scope not in self._cells:
            low = scope & -scope
            self._cells[scope] = self.cells(scope ^ low) * self.lengths[low.bit_length() - 1]
        return self._cells[scope]

    def without(self, scopes: tuple[int, ...], variable: int) -> tuple[float, tuple[int, ...]]:
        """What it costs to sum a variable out, and the scopes that are left, the new one last."""
        self.budget -= 1
        bit = 1 << variable
        bucket = [scope for scope in scopes if scope & bit]
        union = 0
        for scope in bucket:
            union |= scope
        made = union & ~bit
        sides = [self.cells(self._others(bucket, heavy)) for heavy in range(len(bucket))]
        cost = _spent(self.cells(union), self.cells(made), [*map(self.cells, bucket)], sides)
        left = (*[scope for scope in scopes if not scope & bit], made)
        return cost, left

    @staticmethod
    def _others(bucket: Sequence[int], heavy: int) -> int:
        union = 0
        for number, scope in enumerate(bucket):
            if number != heavy:
                union |= scope
        return union

    def try_order(self, order: Sequence[int]) -> None:
        """Take it if it costs least so far."""
        total, scopes = 0.0, self.scopes
        for variable in order:
            cost, scopes = self.without(scopes, variable)
            total += cost
        if total < self.cost:
            self.best, self.cost = tuple(order), total

    def greedily(self, tie: Tie) -> None:
        """Each time the variable that costs least; given up where the budget ends."""
        order: list[int] = []
        scopes, left = self.scopes, set(self.unknown)
        while left:
            if self.budget < 0:
                return
            last = scopes[-1] if order else 0
            weighed = ((*self.without(scopes, v), v) for v in sorted(left))
            _, scopes, variable = min(weighed, key=lambda w: (w[0], tie(w[2], last), w[2]))
            order.append(variable)
            left.remove(variable)
        self.try_order(order)

    def exhaustively(self) -> None:
        """All orders, the cheapest steps first, as far as the budget goes; what cannot be the best is cut off."""
        met: dict[frozenset[int], float] = {}

        def deeper(scopes: tuple[int, ...], left: frozenset[int], done: tuple[int, ...], spent: float) -> None:
            if not left:
                self.best, self.cost = done, spent
                return
            if spent >= met.get(left, inf) or self.budget < 0:
                return
            met[left] = spent
            steps = sorted((self.without(scopes, v)[0], v) for v in left)
            for cost, variable in steps:
                if spent + cost >= self.cost:
                    break
                following = self.without(scopes, variable)[1]
                deeper(following, left - {variable}, (*done, variable), spent + cost)

        deeper(self.scopes, frozenset(self.unknown), (), 0.0)
