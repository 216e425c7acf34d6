"""Factors at many points at once: their logarithms there, and draws from them, without a table over their scope."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from brp.expression import node
from brp.factors import Cases, Density, Factor, Flat
from brp.logs import logarithms
from brp.variables import Variable, cells

__all__ = ["in_order", "log_at", "proposed"]

Array = NDArray[np.float64]
Places = Mapping[Variable, NDArray[np.intp]]

CHUNK = 4_000_000
"""How many logarithms are held at a time while values are drawn."""


def log_at(factor: Factor, places: Places) -> Array:
    """The logarithms of a factor for arrays of places, one for each variable, over their broadcast shape."""
    if isinstance(factor, Flat):
        return np.asarray(-np.log(cells(factor.of)))
    if isinstance(factor, Density):
        return np.asarray(factor.log(*(places[v] for v in factor.scope)))
    if isinstance(factor, Cases):
        command = places[factor.variable]
        met = set(np.unique(command).tolist())
        branches = {id(b): log_at(b, places) for place, b in enumerate(factor.branches) if place in met}
        result: Array = np.asarray(0.0)
        for place in met:
            result = np.where(command == place, branches[id(factor.branches[place])], result)
        return result
    table = logarithms(node(factor), factor.scope)
    at = tuple(places[v] if length > 1 else 0 for v, length in zip(factor.scope, table.shape, strict=True))
    # nan is a question that has no answer there; what would need one is impossible.
    logs: Array = np.nan_to_num(table[at], nan=-np.inf, neginf=-np.inf)
    return logs


def proposed(
    factor: Factor, places: Places, count: int, rng: np.random.Generator
) -> tuple[dict[Variable, NDArray[np.intp]], Array]:
    """Draw what ``places`` leaves open of a factor's left side, for ``count`` particles at once.

    ``places`` has, for each variable right of the bar and for some left of it, an array of shape ``(count,)``.
    Returns the places drawn, and for each particle the logarithm of the probability of what was fixed at the left
    (0 where nothing was). Takes one uniform number a particle, when anything is open.
    """
    free = [v for v in factor.of if v not in places]
    fixed = [v for v in factor.scope if v in places]
    if not free:
        return {}, np.broadcast_to(log_at(factor, places), (count,))
    u = rng.random(count)
    alike = np.stack([places[v] for v in fixed], axis=1) if fixed else np.zeros((count, 0), dtype=np.intp)
    rows, which = np.unique(alike, axis=0, return_inverse=True)
    which = which.reshape(-1)
    drawn = np.zeros(count, dtype=np.intp)
    logs = np.full(count, -np.inf)
    lengths = tuple(map(len, free))
    ends = (1,) * len(free)
    step = max(1, CHUNK // cells(free))
    order = np.argsort(which, kind="stable")
    borders = np.searchsorted(which[order], np.arange(len(rows) + 1))
    for start in range(0, len(rows), step):
        part = rows[start : start + step]
        at = {v: part[:, k].reshape(-1, *ends) for k, v in enumerate(fixed)}
        for axis, v in enumerate(free):
            at[v] = np.arange(len(v)).reshape(1, *(len(v) if k == axis else 1 for k in range(len(free))))
        each = np.broadcast_to(log_at(factor, at), (len(part), *lengths)).reshape(len(part), -1)
        largest = each.max(axis=1, keepdims=True)
        sums = np.cumsum(np.exp(each - np.where(np.isneginf(largest), 0.0, largest)), axis=1)
        with np.errstate(divide="ignore"):
            masses = np.log(sums[:, -1]) + largest[:, 0]
        for row in range(len(part)):
            who = order[borders[start + row] : borders[start + row + 1]]
            logs[who] = masses[row]
            if not np.isneginf(masses[row]):
                found = np.searchsorted(sums[row], u[who] * sums[row, -1], "right")
                # u times the total may round up to the total: then it is the last value that is possible.
                drawn[who] = np.minimum(found, np.searchsorted(sums[row], sums[row, -1], "left"))
    unravelled = np.unravel_index(drawn, lengths)
    return dict(zip(free, unravelled, strict=True)), np.zeros(count) if set(free) == set(factor.of) else logs


def in_order(factors: Sequence[Factor]) -> list[Factor]:
    """The factors, each after those that define what is right of its bar."""
    defining = {v: factor for factor in factors for v in factor.of}
    order: dict[int, Factor] = {}
    waiting = list(reversed(factors))
    while waiting:
        factor = waiting[-1]
        needs = [defining[v] for v in factor.given if v in defining and id(defining[v]) not in order]
        if id(factor) in order or not needs:
            order[id(waiting.pop())] = factor
        else:
            waiting.extend(needs)
    return list(order.values())
