"""The exact, unhurried way to a value: an expression computed in logarithms from one end to the other.

Nothing underflows here, so what is minus infinity at the end is impossible and not merely unlikely. The compiled
plan comes here when its own numbers get too small to be trusted, and to fill the tables that it looks up.
"""

from __future__ import annotations

from collections.abc import Generator, Mapping, Sequence
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brp.expression import Conditional, Leaf, Node, Otherwise, Product, Slice, Soft, Split, Sum, climb
from brp.factors import Density
from brp.variables import Variable, cells

__all__ = ["logarithms"]

BLOCK = 2_000_000
"""A product of more numbers than this is not made before it is summed."""

Logs = NDArray[np.float64]
Part = tuple[tuple[Variable, ...], Logs]
"""Some variables and an array with an axis for each."""


def logarithms(
    start: Node,
    order: Sequence[Variable],
    known: Mapping[Variable, Any] | None = None,
    without: frozenset[Density] = frozenset(),
    soft: Mapping[Variable, Logs] | None = None,
    rows: Variable | None = None,
) -> Logs:
    """The logarithm of ``start`` with ``known`` at their places, an axis for each variable of ``order``.

    A variable of ``order`` that ``start`` does not depend on has an axis of length 1. Minus infinity is zero; nan
    stands where a question within has no answer, because what it knows there is impossible. The densities in
    ``without`` count as 1 everywhere. ``soft`` are the logarithms of the weights of what is known softly. With
    ``rows``, a variable that numbers rows of evidence, known places are arrays of shape ``(len(rows),)``,
    weights of shape ``(len(rows), values)``.
    """
    return _spread(_part(start, dict(known or {}), without, soft or {}, rows), tuple(order))


def _part(
    start: Node,
    fixed: Mapping[Variable, Any],
    without: frozenset[Density],
    weights: Mapping[Variable, Logs],
    rows: Variable | None,
) -> Part:
    """:func:`logarithms` with the axes that come, in the order in which they come."""
    rank: dict[Variable, int] = {}
    done: dict[int, Part] = {}

    def task(here: Node) -> Generator[tuple[Any, ...], Part, Part]:
        if id(here) in done:
            return done[id(here)]
        part: Part
        if isinstance(here, Leaf):
            part = _leaf(here, fixed, without, rows)
        elif isinstance(here, Soft):
            axis = (here.variable,)
            part = axis if rows is None else (rows, *axis), weights[here.variable]
        elif isinstance(here, Sum) and isinstance(here.children[0], Split) and _splits(here):
            split = here.children[0]
            rest = tuple(v for v in here.variables if v != split.variable)
            branches = []
            for branch in split.children:
                branches.append(_sum((yield (branch,)), rest))
            part = _total(branches)
        elif isinstance(here, Sum) and isinstance(here.children[0], Product):
            parts = []
            for child in here.children[0].children:
                parts.append((yield (child,)))
            blocks = cells(_union(parts)) > BLOCK
            part = _by_blocks(parts, here.variables) if blocks else _sum(_product(parts), here.variables)
        elif isinstance(here, Sum):
            part = _sum((yield (here.children[0],)), here.variables)
        elif isinstance(here, Split):
            if here.variable in fixed and rows is not None:
                choice = fixed[here.variable]
                met, which = np.unique(choice, return_inverse=True)
                branches = []
                for place in met:
                    branches.append((yield (here.children[place],)))
                axes = (rows, *(v for v in _union(branches) if v != rows))
                shape = (len(rows), *map(len, axes[1:]))
                chosen = np.stack([np.broadcast_to(_spread(branch, axes), shape) for branch in branches])
                part = axes, chosen[which, np.arange(len(rows))]
            elif here.variable in fixed:
                part = yield (here.children[fixed[here.variable]],)
            else:
                branches = []
                for branch in here.children:
                    branches.append((yield (branch,)))
                axes = _union(branches)
                stacked = np.stack(np.broadcast_arrays(*(_spread(branch, axes) for branch in branches)))
                part = ((here.variable, *axes), stacked)
        elif isinstance(here, Conditional):
            # A question within is normalised before its searched variables can be known around it.
            own = {v: place for v, place in fixed.items() if v in here.variables}
            if own:
                others = {v: place for v, place in fixed.items() if v not in own}
                whole = _part(here, others, without, weights, rows)
                free = (*here.variables, *(v for v in whole[0] if v not in here.variables and v != rows))
                if rows is not None:
                    free = (rows, *free)
                    own[rows] = np.arange(len(rows))
                inside = np.broadcast_to(_spread(whole, free), tuple(map(len, free)))
                # Where rows are chosen by arrays, their axis is the first of what comes out.
                left = tuple(v for v in free if v not in own)
                part = left if rows is None else (rows, *left), inside[tuple(own.get(v, slice(None)) for v in free)]
            else:
                part = _divide((yield (here.children[0],)), here.variables)
        elif isinstance(here, Otherwise):
            parts = [(yield (here.children[0],)), (yield (here.children[1],))]
            axes = _union(parts)
            first, second = np.broadcast_arrays(*(_spread(part, axes) for part in parts))
            part = axes, np.where(np.isnan(first), second, first)
        elif isinstance(here, Slice):
            axes, logs = yield (here.children[0],)
            kept = tuple(v for v in axes if v not in here.fixed)
            part = kept, logs[tuple(here.fixed.get(v, slice(None)) for v in axes)]
        else:
            assert isinstance(here, Product)
            parts = []
            for child in here.children:
                parts.append((yield (child,)))
            part = _product(parts)
        done[id(here)] = part
        return part

    def _union(parts: Sequence[Part]) -> tuple[Variable, ...]:
        # By first appearance and never by the order of a set, which differs from one process to the next.
        axes = dict.fromkeys(v for part in parts for v in part[0])
        for v in axes:
            rank.setdefault(v, len(rank))
        return tuple(sorted(axes, key=rank.__getitem__))

    def _product(parts: Sequence[Part]) -> Part:
        axes = _union(parts)
        total: Logs = np.zeros((1,) * len(axes))
        spread = [_spread(part, axes) for part in parts]
        for logs in spread:
            total = total + logs
        if np.isnan(total).any():
            # An answer that does not exist does not matter where its weight is zero.
            zero = np.logical_or.reduce(np.broadcast_arrays(*(np.isneginf(logs) for logs in spread)))
            total = np.where(zero, -np.inf, total)
        return axes, total

    def _by_blocks(parts: Sequence[Part], variables: Sequence[Variable]) -> Part:
        """The sum of a product that is too large to be made: one value of what is summed after the other."""
        axes = _union(parts)
        summed = [v for v in axes if v in variables]
        left = tuple(v for v in axes if v not in variables)
        total: Logs = np.full(tuple(map(len, left)), -np.inf)
        for at in product(*(range(len(v)) for v in summed)):
            fixed = dict(zip(summed, at, strict=True))
            block = _product(
                [(tuple(v for v in has if v not in fixed), logs[tuple(fixed.get(v, slice(None)) for v in has)])
                 for has, logs in parts]
            )  # fmt: skip
            with np.errstate(invalid="ignore"):
                total = np.logaddexp(total, _spread(block, left))
        return left, total + float(np.log([len(v) for v in variables if v not in axes]).sum())

    def _total(parts: Sequence[Part]) -> Part:
        axes = _union(parts)
        spread = np.broadcast_arrays(*(_spread(part, axes) for part in parts))
        return axes, np.logaddexp.reduce(np.stack(spread), axis=0)

    return climb(task, start)


def _splits(here: Sum) -> bool:
    split = here.children[0]
    return isinstance(split, Split) and split.variable in here.variables


def _leaf(
    leaf: Leaf, known: Mapping[Variable, Any], without: frozenset[Density], rows: Variable | None = None
) -> Part:
    density = leaf.density
    if density in without:
        return (), np.zeros(())
    fixed = {v: known[v] for v in density.scope if v in known} | leaf.fixed
    axes = tuple(v for v in density.scope if v not in fixed)
    told = [v for v in fixed if rows is not None and v not in leaf.fixed]
    if rows is not None and told:
        if "table" in density.__dict__ or not density.light:
            table = density.table[tuple(leaf.fixed.get(v, slice(None)) for v in density.scope)]
            left = [v for v in density.scope if v not in leaf.fixed]
            table = table.transpose([left.index(v) for v in (*told, *axes)])
            return (rows, *axes), table[tuple(known[v] for v in told)]
        mesh = iter(np.ix_(np.arange(len(rows)), *(np.arange(len(v)) for v in axes)))
        next(mesh)
        column = (-1, *(1 for _ in axes))
        places = (
            fixed[v] if v in leaf.fixed else fixed[v].reshape(column) if v in fixed else next(mesh)
            for v in density.scope
        )
        return (rows, *axes), np.broadcast_to(density.log(*places), (len(rows), *map(len, axes)))
    if "table" in density.__dict__:
        return axes, density.table[tuple(fixed.get(v, slice(None)) for v in density.scope)]
    mesh = iter(np.ix_(*(np.arange(len(v)) for v in axes)))
    logs = density.log(*(fixed[v] if v in fixed else next(mesh) for v in density.scope))
    return axes, np.broadcast_to(logs, tuple(map(len, axes)))


def _spread(part: Part, axes: tuple[Variable, ...]) -> Logs:
    """The part's array with an axis for each of ``axes``, of length 1 for those that it does not have."""
    has, logs = part
    if has == axes:
        return logs
    place = {v: number for number, v in enumerate(has)}
    logs = logs.transpose([place[v] for v in axes if v in place])
    return logs.reshape([len(v) if v in place else 1 for v in axes])


def _sum(part: Part, variables: Sequence[Variable]) -> Part:
    axes, logs = part
    summed = tuple(axis for axis, v in enumerate(axes) if v in variables)
    # A variable that the child does not depend on is summed all the same: it counts its values.
    absent = float(np.log([len(v) for v in variables if v not in axes]).sum())
    if not summed:
        return axes, logs + absent
    largest = logs.max(axis=summed, keepdims=True)
    shift = np.where(np.isneginf(largest), 0.0, largest)
    with np.errstate(divide="ignore"):
        total = np.log(np.exp(logs - shift).sum(axis=summed)) + shift.squeeze(summed)
    return tuple(v for v in axes if v not in variables), total + absent


def _divide(part: Part, variables: tuple[Variable, ...]) -> Part:
    axes = part[0]
    order = (*(v for v in axes if v not in variables), *variables)
    spread = _spread(part, order)
    spread = np.broadcast_to(spread, tuple(map(len, order)))
    total = _sum((order, spread), variables)[1]
    with np.errstate(invalid="ignore"):  # minus infinity less itself: the nan that says so
        return order, spread - total[(..., *(None for _ in variables))]
