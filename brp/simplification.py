"""The symbolic phase of section 3.4: from E3.11 to the fewest sums and products that still answer the question.

For P(Searched | Known), over the product of the decomposition's terms [E3.11]:

1. terms over unknown variables that nothing else depends on sum to 1 and vanish;
2. uniform terms are constants and vanish into the normalisation;
3. terms whose variables are all known are constants as well. (One that may be zero is kept, for what it says is
   impossible must stay impossible.);
4. terms over searched and known variables only leave the sum [E3.14];
5. what remains falls into parts that share no unknown variable, and each is summed one variable after the other,
   the cheapest next (generalised distributive law);
6. a Switch is never written out as a table over all that its cases depend on: the sum over its command variable
   becomes a sum of cases, and steps 1 to 5 are done again within each of them.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

from brp.contraction import layout
from brp.expression import (
    Conditional,
    Leaf,
    Node,
    Otherwise,
    Product,
    Slice,
    Soft,
    Split,
    Subroutine,
    Sum,
    at,
    node,
)
from brp.factors import Cases, Factor, Flat
from brp.formula import report
from brp.order import best_order, together
from brp.variables import Variable, cells

__all__ = ["Simplified", "simplify"]


@dataclass(frozen=True)
class Simplified:
    """A question after its simplification, with the account of it.

    ``start`` is the answer, an expression over searched and known variables, divided by its sum over the searched
    ones; ``division`` says whether that sum is anything but 1. ``largest`` is the size of the largest array, in
    numbers, once the known values are put in; ``operations`` counts multiplications.
    """

    start: Conditional
    division: bool
    kept: tuple[Factor, ...]
    summed: tuple[Variable, ...]
    vanished: tuple[Factor, ...]
    flat: tuple[Factor, ...]
    constant: tuple[Factor, ...]
    outside: tuple[Factor, ...]
    order: tuple[Variable, ...]
    largest: int
    operations: int
    beside: tuple[str, ...] = ()
    """The names of the terms that lead to nothing searched or known, and so sum to 1 before all else."""

    def __str__(self) -> str:
        return report(self)


@dataclass
class Account:
    """What the elimination costs, and the order that it took."""

    order: list[Variable] = field(default_factory=list)
    largest: int = 1
    operations: int = 0

    def count(self, scope: Iterable[Variable], result: Iterable[Variable]) -> None:
        """One product over ``scope`` of which an array over ``result`` is kept."""
        self.operations += cells(scope)
        self.largest = max(self.largest, cells(result))


def simplify(
    factors: Sequence[Factor],
    searched: tuple[Variable, ...],
    known: tuple[Variable, ...],
    name: str,
    soft: tuple[Variable, ...] = (),
) -> Simplified:
    """Simplify P(searched | known) over the product of ``factors``; every other variable is unknown.

    The ``soft`` ones among the known are summed out as well, weighed by what is said of them. ``name`` is the
    question's, for refusals.
    """
    opened = _open(factors)
    given = frozenset(known).difference(soft)
    unknown = [v for v in _scope(opened) if v not in given and v not in searched]

    kept, vanished = _drop_sums_to_one(opened, frozenset(unknown).difference(soft))
    flat: list[Factor] = [factor for factor in kept if isinstance(factor, Flat)]
    # Of a searched or unknown variable, a uniform term may be all that makes the product a distribution.
    division = any(not given.issuperset(factor.of) for factor in flat)
    if any(isinstance(factor, Cases) for factor in kept):
        # Where some cases depend on a variable and others do not, its uniform term is what makes them comparable.
        open_ = frozenset(unknown)
        flat = [factor for factor in flat if open_.isdisjoint(factor.of)]
        division = any(not given.issuperset(factor.of) for factor in flat)
    dropped = set(map(id, flat))
    kept = [factor for factor in kept if id(factor) not in dropped]
    constant = [factor for factor in kept if given.issuperset(factor.scope)]
    kept = [factor for factor in kept if not given.issuperset(factor.scope) or factor.vanishes]
    division = division or bool(soft) or any(given.intersection(factor.of) for factor in kept)

    nodes: list[Node] = [node(factor, given) for factor in kept]
    left = frozenset(soft).union(*[n.scope for n in nodes])
    summed = tuple(v for v in unknown if v in left)
    inside = frozenset(summed)
    outside = tuple(
        f for f, n in zip(kept, nodes, strict=True) if inside.isdisjoint(n.scope) and not given.issuperset(f.scope)
    )
    account = Account()
    nodes += [Soft(v) for v in soft]
    parts = [
        part
        for part in _reduce(nodes, summed, account)
        # A part about known values only is a constant too; it matters when it can be zero.
        if part.vanishes or part.scope
    ]
    product = parts[0] if len(parts) == 1 else Product(tuple(parts))
    division = division or not product.scope.issuperset(searched)
    start = Conditional(searched, product, name, given)
    account.count(start.scope, start.scope)
    return Simplified(
        start,
        division,
        tuple(kept),
        summed,
        tuple(vanished),
        tuple(flat),
        tuple(constant),
        outside,
        tuple(account.order),
        account.largest,
        account.operations,
    )


def _open(factors: Iterable[Factor]) -> list[Factor]:
    """Subroutines whose product is a distribution already are replaced by its factors."""
    opened: list[Factor] = []
    for factor in factors:
        if isinstance(factor, Subroutine) and factor.opened is not None:
            opened.extend(_open(factor.opened))
        elif isinstance(factor, Flat):
            # A uniform conjunction is a product of uniform variables, each of which can be dropped by itself.
            opened.extend(Flat((variable,), (), factor.names) for variable in factor.of)
        else:
            opened.append(factor)
    return opened


def _scope(factors: Iterable[Factor]) -> list[Variable]:
    """The variables of all factors, by first appearance."""
    return list(dict.fromkeys(v for factor in factors for v in factor.scope))


def _drop_sums_to_one(factors: Sequence[Factor], unknown: frozenset[Variable]) -> tuple[list[Factor], list[Factor]]:
    """Step 1, as long as there are any; a term that has gone sets free those right of its bar."""
    uses: dict[Variable, int] = {}
    defined: dict[Variable, int] = {}
    for number, factor in enumerate(factors):
        for variable in factor.scope:
            uses[variable] = uses.get(variable, 0) + 1
        for variable in factor.of:
            defined[variable] = number

    def sums_to_one(factor: Factor) -> bool:
        return all(variable in unknown and uses[variable] == 1 for variable in factor.of)

    gone: set[int] = set()
    vanished: list[Factor] = []
    waiting = list(range(len(factors)))[::-1]
    while waiting:
        number = waiting.pop()
        factor = factors[number]
        if number in gone or not sums_to_one(factor):
            continue
        gone.add(number)
        vanished.append(factor)
        for variable in factor.scope:
            uses[variable] -= 1
        waiting.extend(defined[variable] for variable in factor.given if variable in defined)
    return [factor for number, factor in enumerate(factors) if number not in gone], vanished


def _reduce(nodes: Sequence[Node], unknown: Sequence[Variable], account: Account) -> list[Node]:
    """The sum over ``unknown`` of the product of ``nodes``, as factors that no unknown variable joins."""
    rank = {v: number for number, v in enumerate(unknown)}
    inner = rank.keys()
    outside = [n for n in nodes if inner.isdisjoint(n.scope)]
    inside = [n for n in nodes if not inner.isdisjoint(n.scope)]
    for part, variables in _parts(inside, frozenset(unknown)):
        outside.extend(_eliminate(part, sorted(variables, key=rank.__getitem__), account))
    return outside


def _parts(nodes: Sequence[Node], unknown: frozenset[Variable]) -> list[tuple[list[Node], frozenset[Variable]]]:
    """Nodes that an unknown variable joins, directly or through others, stand together; and those variables."""
    joins = [n.scope & unknown for n in nodes]
    users: dict[Variable, list[int]] = {}
    for number, variables in enumerate(joins):
        for variable in variables:
            users.setdefault(variable, []).append(number)
    part_of: set[int] = set()
    parts: list[tuple[list[Node], frozenset[Variable]]] = []
    for number in range(len(nodes)):
        if number in part_of:
            continue
        part_of.add(number)
        part = [number]
        met: set[Variable] = set()
        for member in part:
            for variable in joins[member] - met:
                met.add(variable)
                for other in users[variable]:
                    if other not in part_of:
                        part_of.add(other)
                        part.append(other)
        parts.append(([nodes[number] for number in sorted(part)], frozenset(met)))
    return parts


def _eliminate(nodes: Sequence[Node], unknown: Sequence[Variable], account: Account) -> list[Node]:
    """Sum one joined part over ``unknown``: what no Switch depends on first, then case by case."""
    blocked = {v for n in nodes if isinstance(n, Split) for v in n.scope}
    pool = _sum_out(nodes, [v for v in unknown if v not in blocked], account)
    left = [v for v in unknown if v in blocked]
    if not left:
        return pool
    commands = [n.variable for n in pool if isinstance(n, Split)]
    command = max(dict.fromkeys(commands), key=commands.count)
    touched = [n for n in pool if n.has(command) or n.scope.intersection(left)]
    free = [n for n in pool if not (n.has(command) or n.scope.intersection(left))]
    rest = [v for v in left if v != command]
    made: list[Node] = []
    for place in range(len(command)):
        here = [at(n, command, place) for n in touched]
        reduced = _reduce(_without_sums_to_one(here, rest), rest, account)
        made.append(reduced[0] if len(reduced) == 1 else Product(tuple(reduced)))
    split: Node = Split(command, tuple(made), command not in unknown and not any(command in n.scope for n in pool))
    if command in unknown:
        account.order.append(command)
        account.count(split.scope, split.scope - {command})
        split = Sum((command,), split)
    return [*free, split]


def _without_sums_to_one(nodes: list[Node], unknown: Sequence[Variable]) -> list[Node]:
    """Step 1 within a case: a density whose left side nothing here depends on any more."""
    nodes = list(nodes)
    changed = True
    while changed:
        changed = False
        for n in nodes:
            of = _left(n)
            if of and of.issubset(unknown) and not any(of & other.scope for other in nodes if other is not n):
                nodes.remove(n)
                changed = True
                break
    return nodes


def _left(n: Node) -> frozenset[Variable]:
    """What is left of a node's bar, when it still is a distribution over that."""
    if isinstance(n, Leaf):
        return frozenset(n.density.of) if n.scope.issuperset(n.density.of) else frozenset()
    if isinstance(n, Conditional | Otherwise):
        return frozenset(n.variables)
    if isinstance(n, Split):
        lefts = {_left(branch) for branch in n.children}
        return lefts.pop() if len(lefts) == 1 else frozenset()
    if isinstance(n, Slice) and isinstance(n.children[0], Conditional | Otherwise):
        left = frozenset(n.children[0].variables)
        return left if not left.intersection(n.fixed) else frozenset()
    return frozenset()


def _sum_out(nodes: Sequence[Node], unknown: Sequence[Variable], account: Account) -> list[Node]:
    """Step 5: sum over ``unknown``, one variable after the other."""
    pool: dict[int, Node] = dict(enumerate(nodes))
    users: dict[Variable, set[int]] = {v: set() for v in unknown}
    for k, n in pool.items():
        for v in users.keys() & n.scope:
            users[v].add(k)
    number = len(pool)
    for variable in best_order([n.scope for n in nodes], unknown):
        bucket = sorted(users.pop(variable))
        factors = [pool.pop(k) for k in bucket]
        made = _sum(factors, variable)
        account.order.append(variable)
        account.operations += cells(frozenset().union(*[f.scope for f in factors]))
        account.largest = max(account.largest, cells(made.scope), _multiplied(made))
        pool[number] = made
        for v in made.scope:
            if v in users:
                users[v].difference_update(bucket)
                users[v].add(number)
        number += 1
    return [pool[k] for k in sorted(pool)]


def _multiplied(made: Sum) -> int:
    """The size of the product that is made before it is summed: of all factors but the one it is matched with."""
    members = made.children[0].children if isinstance(made.children[0], Product) else made.children
    plan = layout(members, made.variables, tuple(made.scope), lambda n: n.scope)
    multiplied = members if plan is None else plan.left
    return cells(frozenset().union(*[n.scope for n in multiplied])) if len(multiplied) > 1 else 1


def _sum(factors: Sequence[Node], variable: Variable) -> Sum:
    """The sum of a product; joined with a sum inside it when that needs no larger product.

    So variables that share a big table are summed together: one array of weights, one pass over the table.
    """
    for inner in factors:
        if isinstance(inner, Sum):
            product = inner.children[0]
            others = [f for f in factors if f is not inner]
            if others and not isinstance(product, Split) and all(f.scope <= product.scope for f in others):
                members = product.children if isinstance(product, Product) else (product,)
                result = inner.scope.union(*[f.scope for f in others]).difference((variable,))
                if together([m.scope for m in members], [f.scope for f in others], inner.scope, result):
                    return Sum((*inner.variables, variable), Product((*members, *others)))
    return Sum((variable,), factors[0] if len(factors) == 1 else Product(tuple(factors)))
